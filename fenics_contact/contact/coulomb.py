"""Coulomb friction as a fixed point of Tresca problems: the slip bound follows the normal force."""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np

from fenics_contact.errors import ConvergenceError
from fenics_contact.qp import DualProblem, DualSolution, DualSolver, FeasibleSet, SolverStep, measure, solve


@dataclass(frozen=True)
class FixedPoint:
    """Two loops: Ψ ← given bound + μ λ_N around a solver for given slip bounds.

    Attributes:
        solver: Solver of the Tresca problems; its tolerance is that of every inner answer.
        max_steps: Give up after that many Tresca problems.
    """

    solver: DualSolver
    max_steps: int = 100

    @property
    def tolerance(self) -> float:
        """Largest natural residual with the slip bound that belongs to the answer's own normal force."""
        return self.solver.tolerance

    def run(
        self, problem: DualProblem, coefficient: np.ndarray, tresca_bound: np.ndarray, start: DualSolution | None
    ) -> DualSolution:
        """Solve the Coulomb problem. Collective.

        Args:
            problem: Operators and layout.
            coefficient: μ of each disc, owned, shape (n_friction,).
            tresca_bound: Given part of the slip bound, owned, shape (n_friction,), [force].
            start: A solution to start from, or None.

        Raises:
            ConvergenceError: If the fixed point was not reached; carries the history of all steps.
        """
        history: list[SolverStep] = []
        slip_bound = np.zeros(problem.layout.n_friction) if start is None else start.slip_bound
        solution, products, reached = start, 0, np.inf
        # The inner answers may be as bad as their tolerance; half of it is left to the fixed point.
        inner = replace(self.solver, tolerance=0.5 * self.tolerance)  # type: ignore[type-var]
        for _ in range(self.max_steps):
            solution = solve(problem, slip_bound, inner, solution)
            products += solution.products
            history.extend(solution.history)
            normal = solution.multiplier[problem.layout.tangential_frictional]
            slip_bound = tresca_bound + coefficient * np.maximum(normal, 0.0)
            feasible = FeasibleSet(problem.layout, slip_bound)
            residuals = measure(problem, feasible, solution.multiplier, solution.product, solution.residual)
            if residuals.within(self.tolerance):
                return replace(
                    solution, slip_bound=slip_bound, residuals=residuals, products=products, history=tuple(history)
                )
            reached = residuals.natural
        raise ConvergenceError(
            f"the Coulomb fixed point needs a natural residual below {self.tolerance:.1e}, reached "
            f"{reached:.1e} after {self.max_steps} Tresca problems: raise max_steps, or use FaceNewton, "
            "which updates the slip bound in every step",
            history,
        )
