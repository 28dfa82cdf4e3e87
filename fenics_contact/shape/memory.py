"""Designs that a problem stores: the state from which the next one starts, and the first, best and last."""

from __future__ import annotations

from collections.abc import Callable, Collection, Iterable, Mapping
from dataclasses import dataclass, field
from typing import Protocol

import numpy as np

from fenics_contact.contact import State, stored_state
from fenics_contact.display import displayed
from fenics_contact.shape.linearised_face import WeakChoice, WeakPoints

Stored = dict[str, np.ndarray]

_STATE = "state."
_START = "start"
_SAME = "same"


@displayed
@dataclass(frozen=True, eq=False)
class DesignPoint:
    """An evaluated design.

    Attributes:
        alpha: Design variables, shape (size,).
        value: Objective.
        gradient: The gradient where no point is weakly active, a Clarke subgradient where one is, the
            derivative of the chosen branches where several are, see `WeakChoice`, shape (size,).
        state: Equilibrium.
        weak: Weakly active points and the branch they were given.
        adjoint_iterations: F-products of the adjoint.
        tolerance: Relative residual of the state.
        correction: First-order effect of the state's residuals on the objective, see `state_error`. With an
            adaptive tolerance the value has been corrected by it.
        error: Safe estimate of the error of the value, whether corrected or not, units of the objective.
        adjoint_multiplier: ζ of the adjoint, owned.
    """

    alpha: np.ndarray
    value: float
    gradient: np.ndarray
    state: State
    weak: WeakPoints
    adjoint_iterations: int
    tolerance: float
    correction: float
    error: float
    adjoint_multiplier: np.ndarray = field(repr=False)


class DesignMemory:
    """The last state and the first, best and last design; those of an earlier run as arrays.

    Attributes:
        state: State from which the next one starts, None before the first.
        error_by_tolerance: Error of the last value divided by the tolerance of its state, 0 before the first.
    """

    def __init__(self, restore: Callable[[np.ndarray, Stored], State]) -> None:
        """Start empty.

        Args:
            restore: Builds the state of a design from what `stored_state` returned. Collective.
        """
        self._restore = restore
        self._points: dict[str, DesignPoint | Stored] = {}
        self._alpha: np.ndarray = np.zeros(0)
        self.state: State | None = None
        self.error_by_tolerance = 0.0

    def record_state(self, alpha: np.ndarray, state: State) -> None:
        """Store the last state."""
        self._alpha, self.state = np.array(alpha, dtype=float), state

    def record_point(self, point: DesignPoint) -> None:
        """Store an evaluated design."""
        first, best = self._points.get("first"), self._points.get("best")
        if first is None or np.array_equal(point.alpha, _alpha(first)):
            self._points["first"] = point
        if best is None or point.value < _value(best) or np.array_equal(point.alpha, _alpha(best)):
            self._points["best"] = point
        self._points["last"] = point
        self.error_by_tolerance = point.error / point.tolerance

    def of_design(self, alpha: np.ndarray) -> DesignPoint | None:
        """Return the stored evaluation of exactly this design, if any. Collective after a run was resumed."""
        for name in ("last", "best", "first"):
            if name in self._points and np.array_equal(_alpha(self._points[name]), alpha):
                return self.point(name)
        return None

    def point(self, name: str) -> DesignPoint | None:
        """Return a design by its name; one of an earlier run is rebuilt first. Collective then."""
        stored = self._points.get(name)
        if stored is None or isinstance(stored, DesignPoint):
            return stored
        built = self._built(stored)
        self._points = {key: built if point is stored else point for key, point in self._points.items()}
        return built

    def stored(self) -> Stored:
        """Return everything as arrays. Collective."""
        arrays: Stored = {}
        names: dict[int, str] = {}
        for name, point in self._points.items():
            if id(point) in names:
                arrays[f"{name}.{_SAME}"] = np.array(names[id(point)])
                continue
            names[id(point)] = name
            parts = _stored_point(point) if isinstance(point, DesignPoint) else point
            arrays.update({f"{name}.{part}": values for part, values in parts.items()})
        if self.state is not None:
            arrays[f"{_START}.alpha"] = self._alpha
            arrays[f"{_START}.error"] = np.array(self.error_by_tolerance)
            arrays.update({f"{_START}.{part}": values for part, values in stored_state(self.state).items()})
        return arrays

    def recall(self, arrays: Mapping[str, np.ndarray]) -> None:
        """Load what `stored` returned; only the state to start from is built immediately. Collective."""
        parts: dict[str, Stored] = {}
        for key, values in arrays.items():
            name, _, part = key.partition(".")
            parts.setdefault(name, {})[part] = values
        start = parts.pop(_START, None)
        points = {name: stored for name, stored in parts.items() if _SAME not in stored}
        points |= {name: points[str(stored[_SAME])] for name, stored in parts.items() if _SAME in stored}
        self._points = dict(points)
        if start is not None:
            alpha, self.error_by_tolerance = start.pop("alpha"), float(start.pop("error"))
            self.record_state(alpha, self._restore(alpha, start))

    def _built(self, stored: Stored) -> DesignPoint:
        parts = {part.removeprefix(_STATE): stored[part] for part in stored if part.startswith(_STATE)}
        contacts, discs, edges = (int(count) for count in stored["weak"])
        weak = WeakPoints(contacts, discs, edges, WeakChoice[str(stored["choice"])])
        state = self._restore(stored["alpha"], parts)
        return DesignPoint(
            alpha=stored["alpha"],
            value=_value(stored),
            gradient=stored["gradient"],
            state=state,
            weak=weak,
            adjoint_iterations=int(stored["adjoint_iterations"]),
            tolerance=float(stored["tolerance"]),
            correction=float(stored["correction"]),
            error=float(stored["error"]),
            adjoint_multiplier=stored["adjoint"][state.torn.numbering.owned],
        )


class Remembers(Protocol):
    """What a checkpoint stores, such as a `ShapeProblem`."""

    def fingerprint(self) -> dict[str, str]:
        """Identify it."""

    def memory(self) -> Stored:
        """Return what its next state depends on. Collective."""

    def recall(self, memory: Mapping[str, np.ndarray]) -> None:
        """Continue from what `memory` returned. Collective."""


def joined_fingerprint(problems: Mapping[str, Remembers]) -> dict[str, str]:
    """Identify several problems, under keys that begin with their names."""
    return {
        f"{name}.{key}": text
        for name, problem in problems.items()
        for key, text in problem.fingerprint().items()
    }


def joined_memory(problems: Iterable[Remembers]) -> Stored:
    """Return what several problems remember under keys that begin with their numbers. Collective."""
    return {
        f"{number}/{key}": values
        for number, problem in enumerate(problems)
        for key, values in problem.memory().items()
    }


def recall_joined(problems: Collection[Remembers], memory: Mapping[str, np.ndarray]) -> None:
    """Let several problems continue from what `joined_memory` returned. Collective."""
    parts: list[Stored] = [{} for _ in problems]
    for key, values in memory.items():
        number, _, name = key.partition("/")
        parts[int(number)][name] = values
    for problem, part in zip(problems, parts, strict=True):
        problem.recall(part)


def _stored_point(point: DesignPoint) -> Stored:
    weak, numbering = point.weak, point.state.torn.numbering
    return {
        "alpha": point.alpha,
        "value": np.array(point.value),
        "gradient": point.gradient,
        "weak": np.array([weak.contacts, weak.discs, weak.edges]),
        "choice": np.array(weak.choice.name),
        "adjoint_iterations": np.array(point.adjoint_iterations),
        "tolerance": np.array(point.tolerance),
        "correction": np.array(point.correction),
        "error": np.array(point.error),
        "adjoint": numbering.gather(point.adjoint_multiplier, np.arange(numbering.total)),
        **{f"{_STATE}{part}": values for part, values in stored_state(point.state).items()},
    }


def _value(point: DesignPoint | Stored) -> float:
    return point.value if isinstance(point, DesignPoint) else float(point["value"])


def _alpha(point: DesignPoint | Stored) -> np.ndarray:
    return point.alpha if isinstance(point, DesignPoint) else point["alpha"]
