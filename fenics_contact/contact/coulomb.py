"""Coulomb friction as a fixed point of Tresca problems: the slip bound follows the normal force."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np

from fenics_contact.errors import ConvergenceError
from fenics_contact.qp import (
    DualProblem,
    DualSolution,
    DualSolver,
    SlipLaw,
    SolverStep,
    find_equilibrium,
    measure,
    solve,
)
from fenics_contact.qp.iterate import Start

#: How much more than an equilibrium's own friction the first Tresca problem may use: it must have an answer.
FIRST_MARGIN = 1.1


@dataclass(frozen=True)
class FixedPoint:
    """Two loops: Ψ ← given bound + μ λ_N around a solver for given slip bounds.

    Attributes:
        solver: Solver of the Tresca problems.
        max_steps: Give up after that many Tresca problems.

    Example:
        >>> state = solve_scene(scene, partitions, comm, solver=FixedPoint(Smalse()))  # doctest: +SKIP
    """

    solver: DualSolver
    max_steps: int = 100

    @property
    def tolerance(self) -> float:
        """Largest residual of an answer with the slip bound that belongs to its own normal force."""
        return self.solver.tolerance

    def run(self, problem: DualProblem, law: SlipLaw, start: Start) -> DualSolution:
        """Solve from ``start``; called by `fenics_contact.qp.solve`. Collective.

        Raises:
            InfeasibleError: If a Tresca problem on the way has no equilibrium.
            ConvergenceError: If the fixed point was not reached; carries the history of all steps.
        """
        # The inner answers may be as bad as their tolerance; half of it is left to the fixed point.
        inner = replace(self.solver, tolerance=0.5 * self.tolerance)  # type: ignore[type-var]
        slip_bound = _first_slip_bound(problem, law, start)
        earlier: DualSolution | np.ndarray | None = None if start.cold else start.iterate.multiplier
        history: list[SolverStep] = []
        products, reached = start.operator.products, np.inf
        for _ in range(self.max_steps):
            try:
                solution = solve(problem, slip_bound, inner, earlier)
            except ConvergenceError as failure:
                steps = _continued(history, failure.history, products)
                raise ConvergenceError(str(failure), steps) from failure
            history = _continued(history, solution.history, products)
            products += solution.products
            solution = replace(
                _judged(solution, law), iterations=len(history), products=products, history=tuple(history)
            )
            if solution.residuals.within(self.tolerance):
                return solution
            reached, slip_bound, earlier = solution.natural_residual, solution.slip_bound, solution
        raise ConvergenceError(
            f"the Coulomb fixed point needs a natural residual below {self.tolerance:.1e}, reached "
            f"{reached:.1e} after {self.max_steps} Tresca problems: raise max_steps, or use FaceNewton, "
            "which updates the slip bound in every step",
            history,
        )


def _first_slip_bound(problem: DualProblem, law: SlipLaw, start: Start) -> np.ndarray:
    """Return slip bounds for which the first Tresca problem has an equilibrium. Collective.

    Without friction, the obvious choice, nothing may hold the bodies.
    """
    if not start.cold:
        return law.bound(start.iterate.multiplier)
    return FIRST_MARGIN * law.bound(find_equilibrium(problem, law).multiplier)


def _judged(solution: DualSolution, law: SlipLaw) -> DualSolution:
    """Return a Tresca solution with slip bound and residuals of its own normal forces. Collective."""
    feasible = law.feasible(solution.multiplier)
    residuals = measure(solution.problem, feasible, solution.multiplier, solution.product, solution.residual)
    return replace(solution, slip_bound=feasible.slip_bound, residuals=residuals)


def _continued(history: Sequence[SolverStep], steps: Sequence[SolverStep], products: int) -> list[SolverStep]:
    """Append the steps of another Tresca problem, numbers and products counted on."""
    counted = (
        replace(step, iteration=number, products=products + step.products)
        for number, step in enumerate(steps, len(history))
    )
    return [*history, *counted]
