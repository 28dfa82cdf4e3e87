"""A shorter step where a Newton step made things worse: on a segment every product is already known."""

from __future__ import annotations

from dataclasses import dataclass

from fenics_contact.qp.iterate import Iterate
from fenics_contact.qp.problem import DualProblem
from fenics_contact.qp.residual import measure
from fenics_contact.qp.slip_law import SlipLaw

FRACTIONS = (0.5, 0.25, 0.1, 0.01)


@dataclass(frozen=True, eq=False)
class Damped:
    """The iterate that was kept and the fraction of the step that led to it."""

    iterate: Iterate
    fraction: float


def damp(problem: DualProblem, law: SlipLaw, before: Iterate, after: Iterate) -> Damped:
    """Return the best of a few points between two iterates if the second is worse than the first. Collective.

    F λ and r are linear in λ and α, so no product is spent; the natural residual is not, and often has its
    minimum inside: where the active set alternates between two faces the solution lies between them.
    """
    if not after.residuals.worst > before.residuals.worst:
        return Damped(after, 1.0)
    candidates = [Damped(after, 1.0)]
    candidates += [Damped(_between(problem, law, before, after, part), part) for part in FRACTIONS]
    return min(candidates, key=lambda candidate: candidate.iterate.residuals.worst)


def _between(problem: DualProblem, law: SlipLaw, before: Iterate, after: Iterate, fraction: float) -> Iterate:
    multiplier, product, residual = (
        (1.0 - fraction) * old + fraction * new
        for old, new in (
            (before.multiplier, after.multiplier),
            (before.product, after.product),
            (before.residual, after.residual),
        )
    )
    residuals = measure(problem, law.feasible(multiplier), multiplier, product, residual)
    return Iterate(multiplier, product, residual, residuals)
