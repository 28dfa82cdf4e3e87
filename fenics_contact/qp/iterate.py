"""A multiplier with what is known about it, and where a dual solve starts."""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np

from fenics_contact.progress import Task
from fenics_contact.qp.problem import CountedOperator, DualProblem, Operator
from fenics_contact.qp.reductions import Vector
from fenics_contact.qp.residual import Residuals, measure
from fenics_contact.qp.rigid import fit_rigid_motions
from fenics_contact.qp.slip_law import SlipLaw
from fenics_contact.qp.solution import SmalseMemory, SolverStep


@dataclass(frozen=True, eq=False)
class Iterate:
    """A multiplier on its way to the solution.

    Attributes:
        multiplier: λ, owned.
        product: F λ, owned, recomputed or carried by recursion.
        residual: r = F λ − d − Gᵀα, owned, with the α of the solver.
        residuals: Residuals of λ.
    """

    multiplier: Vector
    product: Vector
    residual: Vector
    residuals: Residuals


@dataclass(frozen=True, eq=False)
class Start:
    """Where a solve begins.

    Attributes:
        iterate: The first multiplier.
        operator: F with its counter, to be used for the whole solve.
        memory: What SMALSE learned before, None if nothing.
        cold: Whether λ is the shortest multiplier in equilibrium, Gᵀ(G Gᵀ)⁻¹e.
        task: The solve, which tells how far it is; None within another.
    """

    iterate: Iterate
    operator: CountedOperator
    memory: SmalseMemory | None = None
    cold: bool = True
    task: Task | None = None

    def reached(self, step: SolverStep) -> None:
        """Tell whoever listens what a step of the solver has reached."""
        if self.task is not None:
            self.task.step(step.products, measure=step.residuals.worst)


def iterate_at(
    problem: DualProblem, law: SlipLaw, multiplier: Vector, product: Vector, alpha: Vector
) -> Iterate:
    """Return the iterate of a multiplier with known product F λ and rigid motions α. Collective."""
    residual = product - problem.rhs - problem.coarse.transpose(alpha)
    residuals = measure(problem, law.feasible(multiplier), multiplier, product, residual)
    return Iterate(multiplier, product, residual, residuals)


def iterate_fitted(problem: DualProblem, law: SlipLaw, multiplier: Vector, product: Vector) -> Iterate:
    """Return the iterate with the rigid motions that fit best, see `fit_rigid_motions`. Collective."""
    return iterate_at(problem, law, multiplier, product, fit_rigid_motions(problem, law, multiplier, product))


def answer_at(
    problem: DualProblem, law: SlipLaw, multiplier: Vector, product: Vector, alpha: Vector
) -> Iterate:
    """Return the iterate with its jumps judged beside the displacements where those are known. Collective.

    On the way to an answer jumps are compared with B K⁺(Bᵀλ − f), which costs nothing more. That says little
    where loads go straight into supports or press thin pieces that are held: alone they would move far.
    """
    iterate = iterate_at(problem, law, multiplier, product, alpha)
    if problem.reach is None:
        return iterate
    # Over all rows: those of supports may not move at all.
    reach = problem.norm(problem.reach(multiplier, alpha))
    return replace(iterate, residuals=iterate.residuals.beside(reach))


def apply_unless_zero(problem: DualProblem, operator: Operator, x: Vector) -> Vector:
    """Return F x, without a product where x is zero on all ranks. Collective."""
    return operator(x) if problem.norm(x) > 0.0 else np.zeros_like(x)
