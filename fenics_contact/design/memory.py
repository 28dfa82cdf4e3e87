"""Evaluated designs, those that a problem stores, and how accurately their states are solved."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass, field
from typing import Generic, Protocol, TypeVar

import numpy as np

from fenics_contact._base.display import displayed
from fenics_contact._equilibrium.problem import ContactProblem
from fenics_contact._equilibrium.steps import stored_state
from fenics_contact.design.adjoint import WeakChoice, WeakPoints
from fenics_contact.errors import InvalidInputError
from fenics_contact.results.deformed_state import AnyState

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
    state: AnyState
    weak: WeakPoints
    adjoint_iterations: int
    tolerance: float
    correction: float
    error: float
    adjoint_multiplier: np.ndarray = field(repr=False)


@displayed
@dataclass(frozen=True, eq=False)
class JointPoint:
    """An evaluated design of several problems: of all load cases, or of all steps of a load path.

    `value`: J, the largest or the sum of the parts; `parts`: name of the case or step -> its state, its own
    objective and its share of the gradient; of a path up to the last step with an objective.
    """

    alpha: np.ndarray
    value: float
    gradient: np.ndarray
    weak: WeakPoints
    parts: Mapping[str, DesignPoint]
    error: float = 0.0

    @property
    def state(self) -> AnyState:
        """Equilibrium of the last part."""
        return list(self.parts.values())[-1].state


class Recorded(Protocol):
    """A design with its objective."""

    @property
    def alpha(self) -> np.ndarray:
        """Its variables."""

    @property
    def value(self) -> float:
        """Its objective."""


RecordedPoint = TypeVar("RecordedPoint", bound=Recorded)


@dataclass(frozen=True, eq=False)
class _Evaluated(Generic[RecordedPoint]):
    """An evaluated design."""

    point: RecordedPoint

    @property
    def alpha(self) -> np.ndarray:
        return self.point.alpha

    @property
    def value(self) -> float:
        return float(self.point.value)

    def built(self, build: Callable[[Stored], RecordedPoint]) -> _Evaluated[RecordedPoint]:
        return self

    def arrays(self, arrays_of: Callable[[RecordedPoint], Stored]) -> Stored:
        return arrays_of(self.point)


@dataclass(frozen=True, eq=False)
class _InArrays:
    """A design of an earlier run."""

    stored: Stored

    @property
    def alpha(self) -> np.ndarray:
        return self.stored["alpha"]

    @property
    def value(self) -> float:
        return float(self.stored["value"])

    def built(self, build: Callable[[Stored], RecordedPoint]) -> _Evaluated[RecordedPoint]:
        return _Evaluated(build(self.stored))

    def arrays(self, arrays_of: Callable[[RecordedPoint], Stored]) -> Stored:
        return self.stored


class DesignRecord(Generic[RecordedPoint]):
    """The first, best and last evaluated design; of an earlier run as arrays until they are asked for."""

    def __init__(
        self, build: Callable[[Stored], RecordedPoint], arrays_of: Callable[[RecordedPoint], Stored]
    ) -> None:
        """Start empty; ``arrays_of`` stores a design, ``build`` rebuilds it (collective)."""
        self._build, self._arrays_of = build, arrays_of
        self._points: dict[str, _Evaluated[RecordedPoint] | _InArrays] = {}
        self.evaluations = 0

    def record(self, point: RecordedPoint) -> None:
        """Store an evaluated design."""
        self.evaluations += 1
        known = _Evaluated(point)
        first, best = (self._points.get(name, known) for name in ("first", "best"))
        if np.array_equal(point.alpha, first.alpha):
            self._points["first"] = known
        if point.value < best.value or np.array_equal(point.alpha, best.alpha):
            self._points["best"] = known
        self._points["last"] = known

    def of_design(self, alpha: np.ndarray) -> RecordedPoint | None:
        """Return the stored evaluation of exactly this design, if any. Collective after a run was resumed."""
        for name in ("last", "best", "first"):
            if name in self._points and np.array_equal(self._points[name].alpha, alpha):
                return self.point(name)
        return None

    def point(self, name: str) -> RecordedPoint | None:
        """Return a design by its name; one of an earlier run is rebuilt first. Collective then."""
        if name not in self._points:
            return None
        known = self._points[name]
        built = known.built(self._build)
        self._points = {key: built if point is known else point for key, point in self._points.items()}
        return built.point

    def stored(self) -> Stored:
        """Return everything as arrays. Collective."""
        arrays: Stored = {"evaluations": np.array(self.evaluations)}
        names: dict[int, str] = {}
        for name, point in self._points.items():
            if id(point) in names:
                arrays[f"{name}.{_SAME}"] = np.array(names[id(point)])
                continue
            names[id(point)] = name
            parts = point.arrays(self._arrays_of)
            arrays.update({f"{name}.{part}": values for part, values in parts.items()})
        return arrays

    def recall(self, arrays: Mapping[str, np.ndarray]) -> None:
        """Continue from what `stored` returned."""
        parts: dict[str, Stored] = {}
        for key, values in arrays.items():
            name, _, part = key.partition(".")
            parts.setdefault(name, {})[part] = values
        self.evaluations = int(parts.pop("evaluations")[""])
        points = {name: _InArrays(stored) for name, stored in parts.items() if _SAME not in stored}
        points |= {name: points[str(stored[_SAME])] for name, stored in parts.items() if _SAME in stored}
        self._points = dict(points)


def record_of_values(again: Callable[[np.ndarray], RecordedPoint]) -> DesignRecord[RecordedPoint]:
    """Return a record that stores variables and values alone; ``again`` finds or evaluates a design anew."""

    def arrays_of(point: RecordedPoint) -> Stored:
        return {"alpha": point.alpha, "value": np.array(point.value)}

    return DesignRecord(lambda stored: again(stored["alpha"]), arrays_of)


class DesignMemory(DesignRecord[DesignPoint]):
    """The evaluated designs of a problem, the state from which the next one starts, and the cost so far.

    `error_by_tolerance`: error of the last value divided by the tolerance of its state, 0 before the first.
    """

    def __init__(self, restore: Callable[[np.ndarray, Stored], AnyState]) -> None:
        """Start empty; ``restore`` builds the state of a design from `stored_state` (collective)."""
        super().__init__(self._built, _stored_point)
        self._restore = restore
        self._alpha: np.ndarray = np.zeros(0)
        self.state: AnyState | None = None
        self.error_by_tolerance, self.products = 0.0, 0

    def record_state(self, alpha: np.ndarray, state: AnyState) -> None:
        """Store the last state."""
        self._alpha, self.state = np.array(alpha, dtype=float), state

    def record(self, point: DesignPoint) -> None:
        """Store an evaluated design."""
        super().record(point)
        self.error_by_tolerance = point.error / point.tolerance

    def stored(self) -> Stored:
        """Return everything as arrays. Collective."""
        arrays = {**super().stored(), "products": np.array(self.products)}
        if self.state is not None:
            arrays[f"{_START}.alpha"] = self._alpha
            arrays[f"{_START}.error"] = np.array(self.error_by_tolerance)
            arrays.update({f"{_START}.{part}": values for part, values in stored_state(self.state).items()})
        return arrays

    def recall(self, arrays: Mapping[str, np.ndarray]) -> None:
        """Load what `stored` returned; only the state to start from is built immediately. Collective."""
        rest = dict(arrays)
        self.products = int(rest.pop("products"))
        names = [key for key in rest if key.startswith(f"{_START}.")]
        start = {key.removeprefix(f"{_START}."): rest.pop(key) for key in names}
        super().recall(rest)
        if start:
            alpha, self.error_by_tolerance = start.pop("alpha"), float(start.pop("error"))
            self.record_state(alpha, self._restore(alpha, start))

    def _built(self, stored: Stored) -> DesignPoint:
        parts = {part.removeprefix(_STATE): stored[part] for part in stored if part.startswith(_STATE)}
        contacts, discs, edges = (int(count) for count in stored["weak"])
        weak = WeakPoints(contacts, discs, edges, WeakChoice[str(stored["choice"])])
        state = self._restore(stored["alpha"], parts)
        return DesignPoint(
            alpha=stored["alpha"],
            value=float(stored["value"]),
            gradient=stored["gradient"],
            state=state,
            weak=weak,
            adjoint_iterations=int(stored["adjoint_iterations"]),
            tolerance=float(stored["tolerance"]),
            correction=float(stored["correction"]),
            error=float(stored["error"]),
            adjoint_multiplier=stored["adjoint"][state.torn.numbering.owned],
        )


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


#: Tolerance of a second attempt relative to the first: at most and at least.
_TIGHTER = (0.3, 1e-3)


@dataclass(frozen=True)
class AdaptiveTolerance:
    """The tolerance follows the optimiser's requests; a single evaluation uses the tightest.

    A state is solved to the relative error that its subgradient may have, or to the tolerance that earlier
    designs suggest for the value. Then the adjoint yields the error of the value; where it is too large, the
    solve is continued. The value of a design is corrected by that error, so that the remainder is of second
    order.

    Attributes:
        loosest: Largest relative residual of a state.
        tightest: Smallest one.
    """

    loosest: float = 1e-3
    tightest: float = 1e-9

    def __post_init__(self) -> None:
        """Reject empty ranges."""
        if not 0.0 < self.tightest <= self.loosest < 1.0:
            raise InvalidInputError(
                f"tolerances need 0 < tightest <= loosest < 1, got {self.tightest:g} and {self.loosest:g}"
            )

    def first(self, value: float, subgradient: float, error_by_tolerance: float) -> float:
        """Return the tolerance to begin with.

        Args:
            value: Largest error of the objective.
            subgradient: Largest relative error of the subgradient.
            error_by_tolerance: Last ratio of the objective's error to the tolerance; 0 if unknown.
        """
        guess = 0.5 * value / error_by_tolerance if error_by_tolerance > 0.0 else np.inf
        return self._clipped(min(subgradient, guess))

    def next(self, tolerance: float, error: float, value: float) -> float:
        """Return the tolerance after one with which the error was too large."""
        most, least = _TIGHTER
        return self._clipped(tolerance * min(most, max(least, 0.3 * value / error)))

    def _clipped(self, tolerance: float) -> float:
        return float(np.clip(tolerance, self.tightest, self.loosest))


def tightest_of(contact: ContactProblem, given: float | AdaptiveTolerance | None) -> float:
    """Return the smallest tolerance of states. Collective."""
    if isinstance(given, AdaptiveTolerance):
        return given.tightest
    return contact.number() if given is None else float(given)
