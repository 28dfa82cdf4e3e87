"""Solutions that are repeated until what they depend on agrees with them, with the history of all passes."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace
from typing import Any

from fenics_contact.errors import ConvergenceError
from fenics_contact.feti.torn import TornSystem
from fenics_contact.qp.solution import SolverStep, continued
from fenics_contact.results.linear_state import LinearState
from fenics_contact.results.state import State, Tolerance

#: Solves a system from the state before, if there is one, to a tolerance.
Solve = Callable[[TornSystem, LinearState | None, Any], LinearState]


class Passes:
    """Passes so far, each of which starts from the last.

    Attributes:
        latest: The last state before them, of an earlier pass around them or of the load step before.
    """

    def __init__(self, solve: Solve, known: LinearState | None, latest: State | None = None) -> None:
        """Start from a known state."""
        self._solve, self._products, self.latest = solve, 0, latest
        self._state = known
        self.count = 0
        self.history: list[SolverStep] = []

    def run(self, torn: TornSystem, tolerance: Tolerance) -> LinearState:
        """Return the state of a system. Collective."""
        try:
            self._state = state = self._solve(torn, self._state, tolerance)
        except ConvergenceError as failure:
            steps = continued(self.history, failure.history, self._products)
            raise ConvergenceError(str(failure), steps) from failure
        self.add(state)
        return state

    def add(self, state: LinearState) -> None:
        """Count a state that was solved, from which the next pass starts."""
        self._state, solution = state, state.dual_solution
        self.history = continued(self.history, solution.history, self._products)
        self._products += solution.products
        self.count += 1

    def remark(self, words: str) -> None:
        """Add words to the note of the last step."""
        self.history[-1] = replace(self.history[-1], note=f"{self.history[-1].note}; {words}")

    def answer(self, state: LinearState) -> LinearState:
        """Return a state with the steps and the products of all passes."""
        found = replace(
            state.dual_solution,
            history=tuple(self.history),
            iterations=len(self.history),
            products=self._products,
        )
        return replace(state, solution=found)
