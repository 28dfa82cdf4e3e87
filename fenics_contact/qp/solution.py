"""What a dual solver answers: the multiplier, how good it is, and how it was found."""

from __future__ import annotations

from dataclasses import dataclass

from fenics_contact.qp.problem import DualProblem
from fenics_contact.qp.reductions import Vector
from fenics_contact.qp.residual import Residuals


@dataclass(frozen=True)
class SolverStep:
    """One line of a solver's history; counts and residuals are global.

    Attributes:
        method: Which algorithm took the step.
        iteration: Number of the step within the solve, from 0.
        products: F-products up to and including this step.
        residuals: Residuals after the step.
        closed: Closed contacts.
        stick: Sticking discs.
        slip: Slipping discs.
        note: What the solver decided, in words; empty for an ordinary step.
        outer: Which of several solves it belongs to, from 0: a Tresca problem of the Coulomb fixed point, or
            a round with a smaller tolerance.
    """

    method: str
    iteration: int
    products: int
    residuals: Residuals
    closed: int
    stick: int
    slip: int
    note: str = ""
    outer: int = 0

    def __str__(self) -> str:
        """Return one readable line."""
        r = self.residuals
        return (
            f"{self.method} {self.iteration}: natural {r.natural:.1e}, gluing {r.gluing:.1e}, coarse "
            f"{r.coarse:.1e}, {self.closed} closed, {self.stick} stick, {self.slip} slip, "
            f"{self.products} products{': ' if self.note else ''}{self.note}"
        )


@dataclass(frozen=True)
class SmalseMemory:
    """What SMALSE learned and can use again for a neighbouring problem.

    Attributes:
        norm: Upper estimate of ‖PFP‖.
        balance: M, the ratio of projected gradient to equilibrium error at which it stopped.
    """

    norm: float
    balance: float


@dataclass(frozen=True, eq=False)
class DualSolution:
    """A multiplier that satisfies every residual to the solver's tolerance.

    Attributes:
        problem: What was solved.
        multiplier: λ, owned.
        residual: r = F λ − d − Gᵀα, owned: minus the violation B u − c of every row.
        product: F λ, owned.
        alpha: Coefficients α of the rigid motions, shape (m,), replicated.
        slip_bound: Ψ at the solution, shape (n_friction,), owned.
        residuals: The residuals, recomputed from `product`.
        iterations: Outer steps of the solver.
        products: F-products of this solve, all purposes.
        history: One record a step, oldest first.
        reason: Why the solver stopped, in words.
        memory: What SMALSE learned, None if it never ran.
    """

    problem: DualProblem
    multiplier: Vector
    residual: Vector
    product: Vector
    alpha: Vector
    slip_bound: Vector
    residuals: Residuals
    iterations: int
    products: int
    history: tuple[SolverStep, ...]
    reason: str
    memory: SmalseMemory | None = None

    @property
    def natural_residual(self) -> float:
        """‖λ − P_Λ(λ − ρ r)‖ over the contact rows, relative to ‖λ_N‖."""
        return self.residuals.natural

    @property
    def gluing_residual(self) -> float:
        """‖r‖ over the equality rows, relative to the displacements that cancel there."""
        return self.residuals.gluing

    @property
    def coarse_residual(self) -> float:
        """Distance of λ from equilibrium relative to ‖λ‖."""
        return self.residuals.coarse
