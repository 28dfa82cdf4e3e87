"""Coulomb friction as a fixed point of Tresca problems: the slip bound follows the normal force."""

from __future__ import annotations

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

#: How much more than an equilibrium's own friction the first Tresca problem may use, so that it has an answer.
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
        history: list[SolverStep] = []
        slip_bound = _first_slip_bound(problem, law, start)
        # The inner answers may be as bad as their tolerance; half of it is left to the fixed point.
        inner = replace(self.solver, tolerance=0.5 * self.tolerance)  # type: ignore[type-var]
        solution: DualSolution | None = None
        products, reached = start.operator.products, np.inf
        for _ in range(self.max_steps):
            earlier = start.iterate.multiplier if solution is None and not start.cold else solution
            solution = _solve_tresca(problem, slip_bound, inner, earlier, history, products)
            products += solution.products
            feasible = law.feasible(solution.multiplier)
            slip_bound = feasible.slip_bound
            residuals = measure(problem, feasible, solution.multiplier, solution.product, solution.residual)
            if residuals.within(self.tolerance):
                return replace(
                    solution,
                    slip_bound=slip_bound,
                    residuals=residuals,
                    iterations=len(history),
                    products=products,
                    history=tuple(history),
                )
            reached = residuals.natural
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


def _solve_tresca(
    problem: DualProblem,
    slip_bound: np.ndarray,
    solver: DualSolver,
    start: DualSolution | np.ndarray | None,
    history: list[SolverStep],
    products: int,
) -> DualSolution:
    """Solve one Tresca problem and append its steps, products counted on. Collective."""
    try:
        solution = solve(problem, slip_bound, solver, start)
        steps = solution.history
    except ConvergenceError as failure:
        steps = failure.history
        raise ConvergenceError(str(failure), (*history, *_counted_on(steps, len(history), products))) from failure
    history.extend(_counted_on(steps, len(history), products))
    return solution


def _counted_on(steps: tuple[SolverStep, ...], first: int, products: int) -> list[SolverStep]:
    return [
        replace(step, iteration=first + index, products=products + step.products) for index, step in enumerate(steps)
    ]
