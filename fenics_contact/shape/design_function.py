"""Another objective as a function of the same designs, at states that are known already."""

from __future__ import annotations

from copy import copy
from typing import Any, Protocol, TypeVar

import numpy as np

from fenics_contact._libraries import MPI
from fenics_contact.contact import State
from fenics_contact.display import displayed
from fenics_contact.fingerprint import described
from fenics_contact.shape.memory import DesignPoint
from fenics_contact.shape.objective import Objective


class Designs(Protocol):
    """What a function of designs needs of a problem; `ShapeProblem` has it."""

    objective: Objective
    products: int

    @property
    def comm(self) -> MPI.Comm:
        """Communicator over which the subdomains are spread."""

    @property
    def inexact(self) -> bool:
        """Whether less accuracy may be requested."""

    def known(self, alpha: np.ndarray) -> DesignPoint | None:
        """Return the stored evaluation of exactly this design, if any. Collective."""

    def state_of(self, alpha: np.ndarray) -> State:
        """Return the equilibrium of a design. Collective."""

    def differentiate(self, state: State) -> DesignPoint:
        """Return value and subgradient at a state. Collective."""

    def beside(self, alpha: np.ndarray, end: np.ndarray) -> np.ndarray:
        """Return a gradient near a design. Collective."""


AnyDesigns = TypeVar("AnyDesigns", bound=Designs)


def aimed(designs: AnyDesigns, objective: Objective) -> AnyDesigns:
    """Return a copy of a problem with another objective, which counts products on its own."""
    other = copy(designs)
    other.objective = objective
    return other


@displayed
class DesignFunction:
    """c(α) of another objective, with a subgradient, at the states of a `ShapeProblem`.

    For constraints: the problem solves the state of a design when its own objective is evaluated, and this
    function costs one adjoint more. At a design whose state is not known it is solved first. Products
    with F are counted by the problem.

    Attributes:
        name: Its name.
        objective: The objective.
    """

    def __init__(self, problem: Designs, objective: Objective, name: str | None = None) -> None:
        """Use `ShapeProblem.function`.

        Args:
            problem: The problem whose states are used.
            objective: The other objective.
            name: Name of the function; by default that of the objective's class.
        """
        self._problem, self._own = problem, aimed(problem, objective)
        self.name, self.objective = name or type(objective).__name__, objective
        self._last: tuple[np.ndarray, DesignPoint] | None = None

    def _facts(self) -> dict[str, Any]:
        return {"name": self.name, "objective": self.objective}

    @property
    def comm(self) -> MPI.Comm:
        """Communicator over which the subdomains are spread."""
        return self._problem.comm

    @property
    def inexact(self) -> bool:
        """Whether an optimiser may ask for less accuracy, see `within`."""
        return self._problem.inexact

    def fingerprint(self) -> dict[str, str]:
        """Identify the function, for a checkpoint."""
        return described(self.objective, f"function {self.name}")

    def __call__(self, alpha: np.ndarray) -> tuple[float, np.ndarray]:
        """Return c(α) and a subgradient, as accurately as the problem can. Collective.

        Raises:
            InvalidDesignError: If the design inverts a cell or has no equilibrium.
        """
        point = self._solved_anew(alpha) if self.inexact else self._judged(alpha)
        return point.value, point.gradient

    def within(self, alpha: np.ndarray, value: float, subgradient: float) -> tuple[float, np.ndarray, float]:
        """Return c(α), a subgradient and the estimated error of c. Collective.

        The known state is used if its effect on c is small enough, else it is solved to the smallest
        tolerance.

        Args:
            alpha: Design variables, shape (size,), [length].
            value: Largest error of c.
            subgradient: Largest relative error of the subgradient, to which the known state was solved.
        """
        point = self._judged(alpha)
        if point.error > value:
            point = self._solved_anew(alpha)
        return point.value, point.gradient, point.error

    def doubtful(self, alpha: np.ndarray) -> bool:
        """Return whether the last result, at α, may not be a subgradient."""
        return self._last is not None and np.array_equal(self._last[0], alpha) and self._last[1].weak.doubtful

    def beside(self, alpha: np.ndarray, end: np.ndarray) -> np.ndarray:
        """Return the gradient of a design near α, see `ShapeProblem.beside`. Collective."""
        before = self._own.products
        gradient = self._own.beside(alpha, end)
        self._problem.products += self._own.products - before
        return gradient

    def _judged(self, alpha: np.ndarray) -> DesignPoint:
        known = self._problem.known(alpha)
        if known is None:
            return self._solved_anew(alpha)
        if self._last is not None and self._last[1].state is known.state:
            return self._last[1]
        return self._differentiated(alpha, known.state, known.state.dual.products)

    def _solved_anew(self, alpha: np.ndarray) -> DesignPoint:
        return self._differentiated(alpha, self._problem.state_of(alpha), 0)

    def _differentiated(self, alpha: np.ndarray, state: State, counted: int) -> DesignPoint:
        point = self._own.differentiate(state)
        self._problem.products += state.dual.products - counted
        self._last = np.array(alpha, dtype=float), point
        return point
