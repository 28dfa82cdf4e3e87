"""Solve no more accurately than the mesh deserves: tolerance, certificate and estimate alternate."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace
from typing import TypeAlias

import numpy as np

from fenics_contact._accuracy.discretisation import DiscretisationError, discretisation_error
from fenics_contact._accuracy.state_errors import (
    BalancedTolerance,
    SolverErrors,
    StateErrors,
    solver_errors,
    state_errors,
)
from fenics_contact._base.progress import PhaseTimer
from fenics_contact.errors import ConvergenceError
from fenics_contact.feti.dual import DualSystem
from fenics_contact.qp.solution import DualSolution, SolverStep, continued
from fenics_contact.qp.solve import DualSolver

#: An estimate is repeated if the solver's error was more than this share of it: jumps between subdomains that
#: are not converged yet raise it by about three times the solver's error.
DOUBTED = 0.1

#: An earlier solution, a multiplier, or nothing.
Start: TypeAlias = DualSolution | np.ndarray | None
#: Solves with a solver from a start, see `solve_dual`.
Solve = Callable[[DualSystem, DualSolver, Start], DualSolution]


def solve_balanced(
    system: DualSystem,
    solve: Solve,
    solver: DualSolver,
    balanced: BalancedTolerance,
    start: Start,
    timer: PhaseTimer,
    good: float = 1e-6,
) -> Rounds:
    """Tighten the tolerance until the solver's error is a share of the mesh's. Collective.

    `good`: a solution this good is accepted where the solver cannot reach the accuracy of the mesh.
    """
    rounds = Rounds(system, timer)
    tolerance, earlier = balanced.loosest, start
    for _ in range(1 + balanced.rounds):
        try:
            rounds.add(solve, solver.with_tolerance(tolerance), earlier)
        except ConvergenceError as failure:
            if not rounds.within(good):
                raise ConvergenceError(str(failure), (*rounds.history, *failure.history)) from failure
            rounds.remark(f"{tolerance:.1e} was not reached, this is accepted")
            break
        if rounds.satisfied(balanced):
            break
        earlier = rounds.last
        tolerance = balanced.tightened(rounds.last.residuals.worst, rounds.errors, rounds.estimate.total)
        if rounds.within(tolerance):
            break
    return rounds


class Rounds:
    """The rounds of a balanced solve: the last solution, its errors, and the history of all."""

    last: DualSolution
    displacement: np.ndarray
    errors: SolverErrors
    estimate: DiscretisationError

    def __init__(self, system: DualSystem, timer: PhaseTimer) -> None:
        """Start without a solution."""
        self._system, self._timer, self._before = system, timer, system.products
        self.history: list[SolverStep] = []
        self._doubted = True

    @property
    def solution(self) -> DualSolution:
        """The last solution with products and steps of all rounds."""
        products = self._system.products - self._before
        return replace(
            self.last, products=products, iterations=len(self.history), history=tuple(self.history)
        )

    def add(self, solve: Solve, solver: DualSolver, start: Start) -> None:
        """Solve once more and bound the error. Collective."""
        system, products = self._system, self._system.products - self._before
        with self._timer.phase("solve"):
            self.last = solve(system, solver, start)
        self.history = continued(self.history, self.last.history, products)
        with self._timer.phase("state"):
            self.displacement = system.displacement(self.last.multiplier, self.last.alpha)
        with self._timer.phase("errors"):
            self.errors = solver_errors(system, self.last)
            if self._doubted:
                self._estimate()
        self.remark(f"solver {self.errors.together:.1e}, mesh {self.estimate.total:.1e} in energy norm")

    def satisfied(self, balanced: BalancedTolerance) -> bool:
        """Return whether the solver's error is within its share, by an estimate that can be trusted."""
        return balanced.satisfied(self.errors, self.estimate.total)

    def _estimate(self) -> None:
        system = self._system
        self.estimate = discretisation_error(system.torn, system.conforming(self.displacement))
        self._doubted = self.errors.together > DOUBTED * self.estimate.total

    def within(self, tolerance: float) -> bool:
        """Return whether there is a solution within a tolerance."""
        return bool(self.history) and self.last.residuals.within(tolerance)

    def remark(self, words: str) -> None:
        """Add words to the note of the last step."""
        step = self.history[-1]
        self.history[-1] = replace(step, note=f"{step.note}; {words}" if step.note else words)

    def state_errors(self, norm: float) -> StateErrors:
        """Return the errors of the state whose displacement has an energy norm, [√(force · length)]."""
        return state_errors(self.errors, self.estimate, norm)
