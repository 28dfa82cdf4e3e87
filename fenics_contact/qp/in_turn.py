"""Solvers in turn: where one stops, the next goes on from the best multiplier that it has found."""

from __future__ import annotations

import logging
from dataclasses import dataclass, replace
from typing import TypeAlias

from fenics_contact.errors.kinds import safe_log
from fenics_contact.qp.face_newton import FaceNewton
from fenics_contact.qp.fixed_point import FixedPoint
from fenics_contact.qp.problem import DualProblem
from fenics_contact.qp.smalse import Smalse
from fenics_contact.qp.solution import DualSolution, SolverStep, Start, StoppedError, continued

_LOG = logging.getLogger(__name__)

#: Solvers that stop after a number of products and then name the best multiplier so far.
Stoppable: TypeAlias = FaceNewton | FixedPoint | Smalse


@dataclass(frozen=True)
class InTurn:
    """Face Newton; where it stops, successive approximations from there, then face Newton again.

    Newton's method with Coulomb's law converges fast from near a solution, and may not converge from
    elsewhere: no method is known that always does. Tresca problems are convex, but their slip bounds approach
    those of the solution slowly. Each solver begins with the best multiplier of the one before it. Which one
    has solved the problem is in the log, in the history and in the `reason` of the solution.

    Attributes:
        solvers: The solvers, in turn.
        max_products: Largest number of F-products of them all.
    """

    solvers: tuple[Stoppable, ...] = (
        FaceNewton(max_products=8_000),
        FixedPoint(FaceNewton(), max_products=20_000),
        FaceNewton(),
    )
    max_products: int = 40_000

    @property
    def tolerance(self) -> float:
        """Largest relative residual of a solution."""
        return self.solvers[0].tolerance

    def with_tolerance(self, tolerance: float) -> InTurn:
        """Return the solvers with another tolerance."""
        return replace(self, solvers=tuple(solver.with_tolerance(tolerance) for solver in self.solvers))

    @property
    def without_rescue(self) -> InTurn:
        """Only the first solver, which stops where it would need a rescue."""
        first = self.solvers[0]
        quick = first.without_rescue if isinstance(first, FaceNewton) else first
        return replace(self, solvers=(quick,))

    def run(self, problem: DualProblem, start: Start) -> DualSolution:
        """Solve from ``start``; called by `solve`. Collective.

        Raises:
            InfeasibleError: Some body is not held.
            ConvergenceError: All solvers stopped; carries the history of all of them.
        """
        history: list[SolverStep] = []
        stopped: list[StoppedError] = []
        products = 0
        for solver in self.solvers:
            most = min(solver.max_products, self.max_products - products)
            if most <= 0:
                break
            try:
                found = replace(solver, max_products=most).run(problem, start)
            except StoppedError as failure:
                stopped.append(failure)
                history = continued(history, failure.history, products)
                products = history[-1].products if history else start.operator.products
                start = self._next_start(problem, start, stopped)
                continue
            return _after(found, history, products, stopped) if stopped else found
        message = "; then ".join(str(failure) for failure in stopped)
        raise StoppedError(message, history, start.iterate) from stopped[-1]

    def _next_start(self, problem: DualProblem, start: Start, stopped: list[StoppedError]) -> Start:
        """Return the start of the next solver, the best multiplier of the one before it."""
        best = stopped[-1].best
        if len(stopped) < len(self.solvers) and problem.comm.rank == 0:
            name, following = (_name(self.solvers[len(stopped) + k]) for k in (-1, 0))
            words = "%s stopped at a residual of %.1e: %s goes on from there"
            safe_log(_LOG.info, words, name, best.residuals.worst, following)
        return Start(best, start.operator.anew(), start.memory, cold=False)


def _name(solver: Stoppable) -> str:
    inner = f" of {type(solver.solver).__name__}" if isinstance(solver, FixedPoint) else ""
    return type(solver).__name__ + inner


def _after(
    found: DualSolution, history: list[SolverStep], products: int, stopped: list[StoppedError]
) -> DualSolution:
    """Return a solution with the steps and products of the solvers that stopped before."""
    steps = continued(history, found.history, products)
    return replace(
        found,
        history=tuple(steps),
        iterations=len(steps),
        products=products + found.products,
        reason=f"{found.reason}; solver {len(stopped) + 1} of those in turn has reached it",
    )
