"""Post-conditions: no answer leaves this package before its residuals were recomputed."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from fenics_contact.qp.iterate import Iterate, answer_at
from fenics_contact.qp.problem import DualProblem, Operator
from fenics_contact.qp.reductions import Vector, global_sum
from fenics_contact.qp.slip_law import SlipLaw
from fenics_contact.qp.solution import DualSolution, SmalseMemory, SolverStep


@dataclass(frozen=True, eq=False)
class Certificate:
    """A multiplier whose product, α and residuals were recomputed from it alone.

    Attributes:
        iterate: The multiplier with its exact product and residuals.
        alpha: α, shape (m,), replicated.
        slip_bound: Ψ, shape (n_friction,), owned.
    """

    iterate: Iterate
    alpha: Vector
    slip_bound: Vector

    def solution(
        self,
        problem: DualProblem,
        history: Sequence[SolverStep],
        products: int,
        memory: SmalseMemory | None = None,
    ) -> DualSolution:
        """Return the answer of a solve that took ``products`` products."""
        return DualSolution(
            problem=problem,
            multiplier=self.iterate.multiplier,
            residual=self.iterate.residual,
            product=self.iterate.product,
            alpha=self.alpha,
            slip_bound=self.slip_bound,
            residuals=self.iterate.residuals,
            iterations=len(history),
            products=products,
            history=tuple(history),
            reason="every residual is below the tolerance",
            memory=memory,
        )


def certify(
    problem: DualProblem, operator: Operator, law: SlipLaw, multiplier: Vector, residual: Vector
) -> Certificate:
    """Recompute everything that can be said about a multiplier. Collective; one product.

    Args:
        problem: The dual problem.
        operator: F, counted.
        law: Where the slip bound comes from.
        multiplier: λ, owned.
        residual: A solver's own r, owned; of it only the choice of α is kept.
    """
    product = operator(multiplier)
    alpha = problem.coarse.coefficients(product - problem.rhs - residual)
    iterate = answer_at(problem, law, multiplier, product, alpha)
    return Certificate(iterate, alpha, law.bound(multiplier))


def count_status(problem: DualProblem, multiplier: Vector, slip_bound: Vector) -> tuple[int, int, int]:
    """Count closed contacts, sticking and slipping discs by the multiplier alone. Collective."""
    layout = problem.layout
    length = np.linalg.norm(multiplier[layout.tangential], axis=1)
    slip = length >= slip_bound * (1.0 - 1e-9)
    counts = global_sum(
        problem.comm,
        np.count_nonzero(multiplier[layout.normal] > 0.0),
        np.count_nonzero(~slip),
        np.count_nonzero(slip & (slip_bound > 0.0)),
    )
    closed, stick, slipping = (round(float(count)) for count in counts)
    return closed, stick, slipping
