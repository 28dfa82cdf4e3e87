"""Solutions that are repeated until what they depend on agrees with them, with the history of all passes."""

from __future__ import annotations

from abc import ABC, abstractmethod
from collections.abc import Callable, Mapping
from dataclasses import replace
from typing import TYPE_CHECKING, Any

import numpy as np

from fenics_contact._scene.scene import Scene
from fenics_contact.errors import ConvergenceError
from fenics_contact.feti.torn import TornSystem
from fenics_contact.qp.solution import SolverStep, continued
from fenics_contact.results.linear_state import LinearState
from fenics_contact.results.state import State, Tolerance

if TYPE_CHECKING:
    from fenics_contact._large_deformations.contact_feedback import ContactFeedback
    from fenics_contact._large_deformations.load_steps import AutomaticSteps
    from fenics_contact._large_deformations.moving_contact import Contact

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


class Relaxation:
    """The part θ of a change that the next pass takes over.

    All of it at first, then what the last two changes r ask for, θ ← −θ r₀·(r₁ − r₀) / ‖r₁ − r₀‖².

    References:
        U. Küttler, W. A. Wall, Fixed-point fluid–structure interaction solvers with dynamic relaxation,
        Comput. Mech. 43 (2008) 61–72.
    """

    def __init__(self) -> None:
        """Begin without a change."""
        self._part, self._last = 1.0, np.zeros(0)

    def of(self, change: np.ndarray) -> float:
        """Return the part of the next change, shape (n,)."""
        if len(self._last):
            turn = change - self._last
            part = -self._part * float(self._last @ turn) / (float(turn @ turn) or 1.0)
            self._part = part if part > 0.0 else 1.0
        self._last = change
        return self._part


class OuterLoop(ABC):
    """An iteration around the dual solver; every pass of it is a solution."""

    #: What its history is that of, in words.
    name: str

    def check(self, last: State, scene: Scene) -> None:
        """Reject a scene after a state that had this loop, if what it leaves would be forgotten."""

    @abstractmethod
    def require_derivatives(self, torn: TornSystem, before: State | None) -> None:
        """Reject systems, and load steps before, with which no derivatives by the shape are known."""

    @abstractmethod
    def solve(self, passes: Passes, torn: TornSystem, before: State | None, tolerance: float) -> LinearState:
        """Repeat solutions until both agree, from where the latest state left this loop. Collective.

        `before`: the state at the end of the load step before.
        """

    def feedback(
        self, contact: Contact, before: State | None, steps: AutomaticSteps
    ) -> tuple[ContactFeedback, ...]:
        """Return what contact of bodies that deform much begins with where a state has left this loop.

        `steps`: how their load is followed. Collective.
        """
        return ()

    @abstractmethod
    def stored(self, torn: TornSystem) -> dict[str, np.ndarray]:
        """Return the arrays from which it is restored."""

    @abstractmethod
    def restored(self, torn: TornSystem, stored: Mapping[str, np.ndarray]) -> TornSystem:
        """Return a system with what was stored. Collective."""

    def stored_feedback(
        self, contact: Contact, stored: Mapping[str, np.ndarray]
    ) -> tuple[ContactFeedback, ...]:
        """Return what contact of bodies that deform much began with in a stored state. Collective."""
        return ()
