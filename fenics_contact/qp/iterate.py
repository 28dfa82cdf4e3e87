"""A multiplier with its product and residuals: start, iterates and certified result of a solve."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np

from fenics_contact.qp.face import classify
from fenics_contact.qp.problem import CountedOperator, DualProblem, Operator
from fenics_contact.qp.reductions import Vector, global_sum
from fenics_contact.qp.solution import (
    DualSolution,
    Residuals,
    SmalseMemory,
    SolverStep,
    contact_step,
    measure,
)

#: Discs inside their slip bound by this relative margin count as sticking where only λ is known.
SLIP_MARGIN = 1e-4


@dataclass(frozen=True, eq=False)
class Iterate:
    """An iterate of the multiplier.

    Attributes:
        multiplier: λ, owned.
        product: F λ, owned, recomputed or updated by recursion.
        residual: r = F λ − d − Gᵀα, owned, with the α of the solver.
        residuals: Residuals of λ.
    """

    multiplier: Vector
    product: Vector
    residual: Vector
    residuals: Residuals

    def motions(self, problem: DualProblem) -> Vector:
        """Return the α of r = F λ − d − Gᵀα, shape (m,), replicated. Collective."""
        return problem.coarse.coefficients(self.product - problem.rhs - self.residual)


@dataclass(frozen=True, eq=False)
class Start:
    """The start of a solve.

    Attributes:
        iterate: The first multiplier.
        operator: F with its counter, to be used for the whole solve.
        memory: Estimates from an earlier SMALSE, or None.
        cold: Whether λ is the shortest multiplier in equilibrium, Gᵀ(G Gᵀ)⁻¹e.
        released: Whether λ is zero because no load acts and friction cannot grip, see `may_grip`.
    """

    iterate: Iterate
    operator: CountedOperator
    memory: SmalseMemory | None = None
    cold: bool = True
    released: bool = False

    def reached(self, step: SolverStep) -> None:
        """Report what a step of the solver has reached."""
        self.operator.report(step.products, step.residuals.worst)


def iterate_at(problem: DualProblem, multiplier: Vector, product: Vector, alpha: Vector) -> Iterate:
    """Return the iterate of a multiplier with known product F λ and rigid motions α. Collective."""
    residual = product - problem.rhs - problem.coarse.transpose(alpha)
    residuals = measure(problem, multiplier, product, residual)
    return Iterate(multiplier, product, residual, residuals)


def iterate_fitted(problem: DualProblem, multiplier: Vector, product: Vector) -> Iterate:
    """Return the iterate with α = (G_F G_Fᵀ)⁻¹ G_F (F λ − d)_F of the rows that are free by λ. Collective.

    Free are the gluing rows, contacts with λ_N > 0, discs well inside their bound, and the tangents of the
    others. There r should vanish; open rows have gaps and slipping ones slip, which must not enter the fit.
    """
    bound = (1.0 - SLIP_MARGIN) * problem.law.bound(multiplier)
    step = contact_step(problem.layout, problem.diagonal)
    face = classify(problem.layout, bound, multiplier, np.zeros_like(multiplier), step)
    free = problem.coarse.restricted(face.restriction)
    alpha = free.coefficients(face.restrict(product - problem.rhs))
    return iterate_at(problem, multiplier, product, alpha)


def iterate_between(problem: DualProblem, before: Iterate, after: Iterate, part: float) -> Iterate:
    """Return the iterate at a fraction of the way from one to another, without a product. Collective."""
    multiplier, product, residual = (
        np.asarray((1.0 - part) * old + part * new, dtype=np.float64)
        for old, new in (
            (before.multiplier, after.multiplier),
            (before.product, after.product),
            (before.residual, after.residual),
        )
    )
    return Iterate(multiplier, product, residual, measure(problem, multiplier, product, residual))


def answer_at(problem: DualProblem, multiplier: Vector, product: Vector, alpha: Vector) -> Iterate:
    """Return the iterate with its jumps relative to the displacements where these are known. Collective.

    During the iteration jumps are compared with B K⁺(Bᵀλ − f), which costs nothing extra. That is a poor
    scale where loads go straight into supports or act on thin parts that are held, which alone would move
    far.
    """
    iterate = iterate_at(problem, multiplier, product, alpha)
    if problem.reach is None:
        return iterate
    # Over all rows: those of supports may not move at all.
    reach = problem.norm(problem.reach(multiplier, alpha))
    return replace(iterate, residuals=iterate.residuals.beside(reach))


def apply_unless_zero(problem: DualProblem, operator: Operator, x: Vector) -> Vector:
    """Return F x, without a product where x is zero on all ranks. Collective."""
    return operator(x) if problem.norm(x) > 0.0 else np.zeros_like(x)


@dataclass(frozen=True, eq=False)
class Certificate:
    """A multiplier whose α and residuals were recomputed from its exact product.

    Attributes:
        problem: The dual problem.
        iterate: The multiplier.
        alpha: α, shape (m,), replicated.
    """

    problem: DualProblem
    iterate: Iterate
    alpha: Vector

    def solution(
        self, history: Sequence[SolverStep], products: int, memory: SmalseMemory | None = None
    ) -> DualSolution:
        """Return the solution of a solve that took ``products`` products."""
        return DualSolution(
            problem=self.problem,
            multiplier=self.iterate.multiplier,
            residual=self.iterate.residual,
            product=self.iterate.product,
            alpha=self.alpha,
            slip_bound=self.problem.law.bound(self.iterate.multiplier),
            residuals=self.iterate.residuals,
            iterations=len(history),
            products=products,
            history=tuple(history),
            reason="every residual is below the tolerance",
            memory=memory,
        )


def certify(problem: DualProblem, multiplier: Vector, product: Vector, residual: Vector) -> Certificate:
    """Recompute α and residuals of a multiplier. Collective.

    Args:
        problem: The dual problem.
        multiplier: λ, owned.
        product: F λ, owned, computed, not updated by recursion.
        residual: A solver's own r, owned; only its α is used.
    """
    alpha = problem.coarse.coefficients(product - problem.rhs - residual)
    return Certificate(problem, answer_at(problem, multiplier, product, alpha), alpha)


def count_status(problem: DualProblem, multiplier: Vector) -> tuple[int, int, int]:
    """Count closed contacts, sticking and slipping discs by the multiplier alone. Collective."""
    layout, slip_bound = problem.layout, problem.law.bound(multiplier)
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
