"""The caller's function, guarded: copies go in, checked numbers come out."""

from __future__ import annotations

import logging
from collections.abc import Callable, Sequence
from dataclasses import dataclass, field, replace
from typing import Any, Protocol, runtime_checkable

import numpy as np
from numpy.typing import ArrayLike, NDArray

from fenics_contact.errors import InvalidDesignError, InvalidInputError
from fenics_contact.errors.kinds import safe_log

Array = NDArray[np.float64]
Fun = Callable[[Array], tuple[float, ArrayLike]]

_LOG = logging.getLogger(__name__)


class Function(Protocol):
    """A function of x, shape (n,), that says more of itself than values."""

    def __call__(self, x: Array) -> tuple[float, ArrayLike]:
        """Return value and one subgradient, as accurately as it can."""


@runtime_checkable
class Inexact(Function, Protocol):
    """A function that is cheaper to evaluate less accurately, such as one of an iteratively solved state."""

    @property
    def inexact(self) -> bool:
        """Whether `within` can save anything; else it is not called."""

    def within(self, x: Array, value: float, subgradient: float) -> tuple[float, ArrayLike, float]:
        """Return the value, a subgradient, and the estimated error of the value."""


@runtime_checkable
class Kinked(Function, Protocol):
    """A piecewise smooth function that knows where it cannot decide on which piece a point lies.

    There it returns the gradient of some combination of pieces, which need not occur at any nearby point: it
    may not be a subgradient. The method uses it until it would stop on it; then it requests the gradient near
    the point.
    """

    def may_be_invalid(self, x: Array) -> bool:
        """Return whether the last result, at x, may not be a subgradient."""

    def gradient_near(self, x: Array, end: Array) -> ArrayLike:
        """Return a gradient at a point on the way from x to end, as near to x as a piece can be identified.

        Raises `InvalidDesignError` where the function does not exist there.

        Args:
            x: Point, shape (n,).
            end: A feasible point near x, in a generic direction, shape (n,).
        """


@runtime_checkable
class Remarked(Function, Protocol):
    """A function with remarks on a point; those on the last one are logged, once."""

    def remarks(self, x: Array) -> Sequence[str]:
        """Return what to know about a point, in whole sentences; nothing if there is nothing."""


@runtime_checkable
class MaxFunction(Function, Protocol):
    """A maximum J = max J_k of functions, several of which an evaluation knows, such as of load cases.

    The planes of all of them enter the model: fewer evaluations are needed to find where they are equal.
    """

    def pieces(self, x: Array) -> tuple[ArrayLike, ArrayLike]:
        """Return what the evaluation at x, the last one, knows of the other functions.

        Args:
            x: Point, shape (n,).

        Returns:
            J_k(x), not above J(x), shape (k,), and a subgradient of each, shape (k, n).
        """


@dataclass(frozen=True)
class Accuracy:
    """Requested accuracy of an evaluation: 0 for the best possible, inf for any."""

    value: float = 0.0
    subgradient: float = 0.0


@dataclass(frozen=True)
class Evaluation:
    """Value and subgradient at a point.

    `asked_value`: allowed error of the value, 0 for an exact function; `turned`: relative change of the
    subgradient since a less accurate evaluation of the same point: 0 for an exact function, inf without such
    an evaluation; `doubtful`: whether it, or one of a constraint, may not be a subgradient, see `Kinked`;
    `pieces`: values at x of other functions of which J is the largest, see `MaxFunction`.
    """

    x: Array
    value: float
    subgradient: Array
    error: float = 0.0
    asked_value: float = 0.0
    asked_subgradient: float = 0.0
    turned: float = 0.0
    doubtful: bool = False
    constraints: Array = field(default_factory=lambda: np.zeros(0))
    slopes: Array = field(default_factory=lambda: np.zeros((0, 0)))
    constraint_errors: Array = field(default_factory=lambda: np.zeros(0))
    pieces: Array = field(default_factory=lambda: np.zeros(0))
    piece_slopes: Array = field(default_factory=lambda: np.zeros((0, 0)))


def can_be_inexact(fun: Fun) -> bool:
    """Return whether a function can save work by lower accuracy."""
    return isinstance(fun, Inexact) and fun.inexact


def evaluate(
    fun: Fun, x: Array, number: int, accuracy: Accuracy | None = None, name: str = "fun"
) -> Evaluation:
    """Call the function with a copy of x and check what it returns."""
    if accuracy is None or not (isinstance(fun, Inexact) and fun.inexact):
        evaluation = _checked(fun(x.copy()), x, f"at evaluation {number}", name)
    else:
        value, subgradient, error = fun.within(x.copy(), accuracy.value, accuracy.subgradient)
        evaluation = replace(
            _checked((value, subgradient), x, f"at evaluation {number}", name),
            error=float(error),
            asked_value=accuracy.value,
            asked_subgradient=accuracy.subgradient,
            turned=float(np.inf),
        )
    evaluation = replace(evaluation, doubtful=isinstance(fun, Kinked) and bool(fun.may_be_invalid(x.copy())))
    return (
        _with_pieces(fun, evaluation, f"at evaluation {number}")
        if isinstance(fun, MaxFunction)
        else evaluation
    )


def _with_pieces(fun: MaxFunction, evaluation: Evaluation, where: str) -> Evaluation:
    """Return the evaluation with those of other functions of which J is the largest."""
    given = fun.pieces(evaluation.x.copy())
    values, slopes = (np.array(part, dtype=float) for part in given)
    if values.ndim != 1 or slopes.shape != (values.size, evaluation.x.size):
        raise InvalidInputError(
            f"pieces must return (k,), (k, {evaluation.x.size}), got {values.shape}, {slopes.shape} {where}"
        )
    require_finite("pieces must return finite values", values, where)
    require_finite("pieces must return finite subgradients", slopes, where)
    return replace(evaluation, pieces=np.minimum(values, evaluation.value), piece_slopes=slopes)


def with_gradient_near(
    fun: Fun, evaluation: Evaluation, end: Array, number: int, name: str = "fun"
) -> Evaluation:
    """Return a doubtful evaluation with a nearby gradient as its subgradient; any other unchanged.

    Where the function does not exist near the point, its result at the point is used.
    """
    if not (evaluation.doubtful and isinstance(fun, Kinked)):
        return evaluation
    try:
        gradient = fun.gradient_near(evaluation.x.copy(), end.copy())
    except InvalidDesignError as error:
        safe_log(_LOG.warning, "the subgradient of evaluation %d may be invalid: %s", number, error)
        return replace(evaluation, doubtful=False)
    checked = _checked((evaluation.value, gradient), evaluation.x, f"near evaluation {number}", name)
    return replace(evaluation, subgradient=checked.subgradient, doubtful=False)


def _checked(answer: Any, x: Array, where: str, name: str = "fun") -> Evaluation:
    if not isinstance(answer, tuple) or len(answer) != 2:
        raise InvalidInputError(
            f"{name} must return (value, subgradient), got {type(answer).__name__} {where}"
        )
    value, subgradient = np.array(answer[0], dtype=float), np.array(answer[1], dtype=float)
    if value.size != 1 or subgradient.shape != x.shape:
        raise InvalidInputError(
            f"{name} needs a number and subgradient {x.shape}, got {value.shape}, {subgradient.shape} {where}"
        )
    require_finite(f"{name} must return a finite value", value, where)
    require_finite(f"{name} must return a finite subgradient", subgradient, where)
    return Evaluation(x.copy(), float(value.item()), subgradient)


def require_finite(needed: str, numbers: Array, where: str) -> None:
    """Refuse numbers that are not finite."""
    bad = np.flatnonzero(~np.isfinite(numbers))
    if bad.size:
        raise InvalidInputError(
            f"{needed}, got {numbers.ravel()[bad[0]]} in entry {bad[0]} {where}: or raise InvalidDesignError"
        )
