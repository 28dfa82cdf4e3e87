"""Designs that a load path has evaluated: the first, the best and the last."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass

import numpy as np

from fenics_contact.contact import State
from fenics_contact.display import displayed
from fenics_contact.shape.linearised_face import WeakPoints
from fenics_contact.shape.memory import DesignPoint


@displayed
@dataclass(frozen=True, eq=False)
class PathPoint:
    """An evaluated design of a `LoadPath`.

    Attributes:
        alpha: Design variables, shape (size,), [length].
        value: J, the sum over all steps.
        gradient: Its gradient or subgradient, see `DesignPoint`, shape (size,).
        weak: Weakly active points of all steps.
        steps: Name of the step -> its state, its own objective and its share of the gradient, up to the last
            step with an objective.
    """

    alpha: np.ndarray
    value: float
    gradient: np.ndarray
    weak: WeakPoints
    steps: Mapping[str, DesignPoint]

    @property
    def state(self) -> State:
        """Equilibrium after the last of these steps."""
        return list(self.steps.values())[-1].state


class PathPoints:
    """The first, best and last design of a path; of an earlier run their variables and values alone."""

    def __init__(self, evaluate: Callable[[np.ndarray], PathPoint]) -> None:
        """Start empty.

        Args:
            evaluate: Evaluates a design of an earlier run anew when it is asked for. Collective.
        """
        self._evaluate = evaluate
        self._points: dict[str, PathPoint] = {}
        self._known: dict[str, np.ndarray] = {}

    def record(self, point: PathPoint) -> None:
        """Keep an evaluated design."""
        best = self._known.get("best")
        for name, keeps in (
            ("first", "first" not in self._known),
            ("best", best is None or point.value < best[0]),
            ("last", True),
        ):
            if keeps:
                self._points[name], self._known[name] = point, np.append(point.value, point.alpha)

    def point(self, name: str) -> PathPoint | None:
        """Return a design by its name. Collective where it is one of an earlier run."""
        if name in self._known and name not in self._points:
            known = self._known[name]
            found = self._evaluate(known[1:])
            self._points |= {key: found for key, other in self._known.items() if np.array_equal(other, known)}
        return self._points.get(name)

    def of_design(self, alpha: np.ndarray) -> PathPoint | None:
        """Return the evaluation of exactly this design, if it is kept. Collective as `point` is."""
        names = (name for name, known in self._known.items() if np.array_equal(known[1:], alpha))
        return next((self.point(name) for name in names), None)

    def stored(self) -> dict[str, np.ndarray]:
        """Return values and variables by name, shape (1 + size,) each."""
        return dict(self._known)

    def recall(self, stored: Mapping[str, np.ndarray]) -> None:
        """Continue from what `stored` returned."""
        self._points, self._known = {}, dict(stored)
