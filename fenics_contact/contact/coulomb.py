"""Coulomb friction as a fixed point of Tresca problems: the slip bound follows the normal force."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field, replace

import numpy as np

from fenics_contact.contact.slip_bounds import Damping, SlipBoundSequence
from fenics_contact.errors import ConvergenceError
from fenics_contact.qp import (
    DualProblem,
    DualSolution,
    DualSolver,
    SolverStep,
    Start,
    TrescaLaw,
    find_equilibrium,
    measure,
    solve,
)

#: Factor on an equilibrium's own friction in the first Tresca problem, so that it surely has a solution.
FIRST_MARGIN = 1.1


@dataclass(frozen=True)
class FixedPoint:
    """Two loops: Ψ ← given bound + μ λ_N around a solver for given slip bounds.

    A Tresca problem is solved no more accurately than the slip bound deserves: its tolerance follows the
    natural residual that its solution will have with its own slip bound. The bound is updated undamped;
    only where the bounds cycle or the residual stops falling are they damped, as the history reports.

    Attributes:
        solver: Solver of the Tresca problems.
        max_steps: Largest number of Tresca problems.
        forcing: Tolerance of a Tresca problem relative to the last natural residual.
        loosest: Largest tolerance, that of the first Tresca problem.
        damping: What to do where the plain iteration cycles.

    References:
        J. Haslinger, Z. Dostál, R. Kučera, On a splitting type algorithm for the numerical realization of
        contact problems with Coulomb friction, CMAME 191 (2002).

    Example:
        >>> state = solve_scene(scene, comm, solver=FixedPoint(Smalse()))  # doctest: +SKIP
    """

    solver: DualSolver
    max_steps: int = 200
    forcing: float = 0.1
    loosest: float = 1e-2
    damping: Damping = field(default_factory=Damping)

    @property
    def tolerance(self) -> float:
        """Largest residual of a solution with the slip bound that belongs to its own normal force."""
        return self.solver.tolerance

    def with_tolerance(self, tolerance: float) -> FixedPoint:
        """Return the fixed point around its solver with another tolerance."""
        return replace(self, solver=self.solver.with_tolerance(tolerance))

    def run(self, problem: DualProblem, start: Start) -> DualSolution:
        """Solve from ``start``; called by `fenics_contact.qp.solve`. Collective.

        Raises:
            InfeasibleError: If a Tresca problem on the way has no equilibrium.
            ConvergenceError: If the fixed point was not reached; carries the history of all steps.
        """
        slip_bound = _first_slip_bound(problem, start)
        sequence = SlipBoundSequence(problem.comm, self.damping)
        earlier: DualSolution | np.ndarray | None = None if start.cold else start.iterate.multiplier
        history: list[SolverStep] = []
        products, reached = start.operator.products, np.inf
        for number in range(self.max_steps):
            try:
                solution = solve(problem, slip_bound, self._inner(sequence.fraction * reached), earlier)
            except ConvergenceError as failure:
                steps = _continued(history, failure.history, products)
                raise ConvergenceError(
                    f"the Coulomb fixed point needs residuals below {self.tolerance:.1e}, but its Tresca "
                    f"problem {number} failed: {failure}",
                    steps,
                ) from failure
            history = _continued(history, solution.history, products)
            products += solution.products
            solution = _under_own_bound(problem, solution)
            reached = solution.natural_residual
            slip_bound, note = sequence.advance(slip_bound, solution.slip_bound, reached)
            history[-1] = replace(history[-1], note=f"{history[-1].note}; {note}")
            start.reached(replace(history[-1], residuals=solution.residuals))
            if solution.residuals.within(self.tolerance):
                return replace(solution, iterations=len(history), products=products, history=tuple(history))
            if sequence.exhausted:
                break
            earlier = solution
        raise ConvergenceError(self._failure(sequence, reached), history)

    def _inner(self, residual: float) -> DualSolver:
        """Return the solver of the next Tresca problem, given the error that its slip bound has already."""
        # Inner solutions may be as inaccurate as their tolerance allows; half of it is left to the fixed
        # point.
        tolerance = max(0.5 * self.tolerance, min(self.loosest, self.forcing * residual))
        return self.solver.with_tolerance(tolerance)

    def _failure(self, sequence: SlipBoundSequence, reached: float) -> str:
        needed = (
            f"the Coulomb fixed point needs a natural residual below {self.tolerance:.1e}, reached "
            f"{reached:.1e}"
        )
        if sequence.exhausted:
            fractions = ", ".join(f"{fraction:g}" for fraction in self.damping.fractions)
            return (
                f"{needed}: it cycles or stands still with every θ of {fractions}; use FaceNewton, which "
                "updates the slip bound in every step, or give Damping smaller fractions"
            )
        return (
            f"{needed} after {self.max_steps} Tresca problems: raise max_steps, or use FaceNewton, which "
            "updates the slip bound in every step"
        )


def _first_slip_bound(problem: DualProblem, start: Start) -> np.ndarray:
    """Return slip bounds for which the first Tresca problem has an equilibrium. Collective.

    Zero, the obvious choice, might leave a body unheld, and so might the bounds of another load.
    """
    if not start.cold:
        bound = problem.law.bound(start.iterate.multiplier)
        if find_equilibrium(problem.with_law(TrescaLaw(problem.layout, bound))).motion is None:
            return bound
    return FIRST_MARGIN * problem.law.bound(find_equilibrium(problem).multiplier)


def _under_own_bound(problem: DualProblem, solution: DualSolution) -> DualSolution:
    """Return a Tresca solution with slip bound and residuals of its own normal forces. Collective."""
    residuals = measure(problem, solution.multiplier, solution.product, solution.residual)
    return replace(solution, slip_bound=problem.law.bound(solution.multiplier), residuals=residuals)


def _continued(history: Sequence[SolverStep], steps: Sequence[SolverStep], products: int) -> list[SolverStep]:
    """Append the steps of another Tresca problem, continuing the count of steps and products."""
    outer = history[-1].outer + 1 if history else 0
    counted = (
        replace(step, iteration=number, products=products + step.products, outer=outer)
        for number, step in enumerate(steps, len(history))
    )
    return [*history, *counted]
