"""A shorter step where a Newton step made things worse: on a segment every product is already known."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np

from fenics_contact.qp.iterate import Iterate
from fenics_contact.qp.problem import DualProblem
from fenics_contact.qp.reductions import global_sum
from fenics_contact.qp.residual import Residuals, contact_step, measure
from fenics_contact.qp.slip_law import SlipLaw

FRACTIONS = (0.5, 0.25, 0.1)
#: Taken only near a solution: far from one, a step as short as this stays where nothing is known yet.
SHORTEST = 0.01
#: The largest relative residual that counts as near.
NEAR = 0.5
#: The whole step is taken where the potential rises at its end by less than this fraction of its first fall.
STEEP = 0.3
#: The slope at which a minimum of the potential counts as found, relative to the first one.
LEVEL = 0.1
#: Gluing residual from which on bodies are in pieces, and their potential says nothing.
TORN = 0.1


@dataclass(frozen=True, eq=False)
class Damped:
    """The iterate that was kept and the fraction of the step that led to it."""

    iterate: Iterate
    fraction: float


def damp(
    problem: DualProblem, law: SlipLaw, before: Iterate, after: Iterate, earlier: Residuals | None = None
) -> Damped:
    """Return the best of a few points between two iterates if the second is worse than the first. Collective.

    F λ and r are linear in λ and α, so no product is spent; the natural residual is not, and often has its
    minimum inside: where the active set alternates between two faces the solution lies between them. The
    way to the right face may lead over a worse one: a step is whole that improves on either of two.

    Args:
        problem: The dual problem.
        law: Where the slip bound comes from.
        before: Where the step began.
        after: Where it ended.
        earlier: Residuals of the iterate before that, if there was one.
    """
    for residuals in (before.residuals, earlier):
        if residuals is not None and not _worse(after.residuals, residuals):
            return Damped(after, 1.0)
    candidates = [Damped(after, 1.0)]
    fractions = (*FRACTIONS, SHORTEST) if before.residuals.worst < NEAR else FRACTIONS
    candidates += [Damped(_between(problem, law, before, after, part), part) for part in fractions]
    return min(candidates, key=lambda candidate: candidate.iterate.residuals.worst_beside(after.residuals))


def descend(problem: DualProblem, law: SlipLaw, before: Iterate, after: Iterate) -> Damped:
    """Return the minimum between two iterates of the potential that a proximal point minimises. Collective.

    The potential energy of displacements u(λ, α) together with that of springs ρ in all contacts and discs is
    convex; its derivative along a step is that of r, against the force λ that deforms the bodies less the
    force P_Λ(λ − ρ r) of the springs. Bodies in pieces come together first, whatever the potential.

    Args:
        problem: Problem of a proximal point, F + D with ρ = 1/D.
        law: Tresca's law.
        before: Where the step began.
        after: Where it ended.
    """
    slope = _slope(problem, law, before, after)
    first, last = slope(0.0), slope(1.0)
    if first >= 0.0 or last <= -STEEP * first or before.residuals.gluing > TORN:
        return Damped(after, 1.0)
    left, right, low, high = 0.0, 1.0, first, last
    for _ in range(30):
        part = left + (right - left) * min(max(-low / (high - low), 0.1), 0.9)
        value = slope(part)
        if abs(value) <= -LEVEL * first:
            break
        if value < 0.0:
            left, low = part, value
        else:
            right, high = part, value
    return Damped(_between(problem, law, before, after, part), part)


def _worse(one: Residuals, other: Residuals) -> bool:
    return one.worst > other.worst and one.worst_beside(other) > other.worst_beside(one)


def _slope(problem: DualProblem, law: SlipLaw, before: Iterate, after: Iterate) -> Callable[[float], float]:
    """Return the derivative of the potential as a function of the fraction of a step. Collective to call."""
    layout, step = problem.layout, contact_step(problem.layout, problem.diagonal)
    moved, turned = after.multiplier - before.multiplier, after.residual - before.residual
    opened = turned.copy()
    opened[layout.contact] -= moved[layout.contact] / step[layout.contact]

    def slope(part: float) -> float:
        multiplier = before.multiplier + part * moved
        trial = multiplier - step * (before.residual + part * turned)
        missing = multiplier - law.feasible(multiplier).project(trial)
        missing[layout.equality] = (part - 1.0) * moved[layout.equality]
        return float(global_sum(problem.comm, opened @ missing)[0])

    return slope


def _between(problem: DualProblem, law: SlipLaw, before: Iterate, after: Iterate, fraction: float) -> Iterate:
    multiplier, product, residual = (
        np.asarray((1.0 - fraction) * old + fraction * new, dtype=np.float64)
        for old, new in (
            (before.multiplier, after.multiplier),
            (before.product, after.product),
            (before.residual, after.residual),
        )
    )
    residuals = measure(problem, law.feasible(multiplier), multiplier, product, residual)
    return Iterate(multiplier, product, residual, residuals)
