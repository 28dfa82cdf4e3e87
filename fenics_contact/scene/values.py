"""Values of loads and supports: numbers, functions of position, or UFL."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
from ufl.core.expr import Expr

from fenics_contact.checks import checked
from fenics_contact.errors import InvalidInputError, user_code

#: A function of points, shape (n, dim), [length], with a row (a vector) or a number (a scalar) for each.
OfPosition = Callable[[np.ndarray], np.ndarray]


@dataclass(frozen=True)
@checked()
class Ufl:
    """A value written in UFL: compiled into the form and evaluated at its quadrature points.

    Numbers in it are compiled in, too: for a load that changes from step to step a function of position,
    which needs no compiler, is cheaper. Derivatives by the shape of a body are exact for numbers and UFL;
    gradients of functions of position are central differences, see `gradients_of`.

    Attributes:
        function: Takes the spatial coordinate (UFL), returns a UFL vector or scalar.

    Example:
        Hydrostatic pressure:

        >>> Pressure("dam", "front", Ufl(lambda x: 9.81e-6 * (2e4 - x[2]))).surface
        'front'
    """

    function: Callable[[Expr], Expr | float | Sequence[Expr | float]]


#: A vector: numbers, a function of positions, or UFL.
VectorValue = Sequence[float] | OfPosition | Ufl
#: A number, a function of positions, or UFL.
ScalarValue = float | OfPosition | Ufl


def checked_vector(name: str, value: Any) -> Any:
    """Return numbers as a tuple of floats, a function or UFL as it is.

    Raises:
        InvalidInputError: If it is not a vector of two or three components.
    """
    if isinstance(value, Ufl) or callable(value):
        return value
    array = finite_numbers(value)
    if array is None or array.shape not in ((2,), (3,)):
        raise InvalidInputError(
            f"{name} must be three finite numbers (two for a plane body), got {value!r}: give one for x, y "
            "and z, or a function of the points"
        )
    return tuple(float(component) for component in array)


def checked_scalar(name: str, value: Any) -> Any:
    """Return a number as a float, a function or UFL as it is.

    Raises:
        InvalidInputError: If it is none of them.
    """
    if isinstance(value, Ufl) or callable(value):
        return value
    array = finite_numbers(value)
    if array is None or array.shape != ():
        raise InvalidInputError(
            f"{name} must be a finite number, got {value!r}: give a number or a function of the points"
        )
    return float(array)


def finite_numbers(value: Any) -> np.ndarray | None:
    """Return a value as an array of floats, None if it is something other than finite numbers."""
    try:
        array = np.asarray(value, dtype=np.float64)
    except (TypeError, ValueError):
        return None
    return array if np.isfinite(array).all() else None


def evaluate(name: str, function: OfPosition, points: np.ndarray, shape: tuple[int, ...]) -> np.ndarray:
    """Evaluate a function of position.

    Args:
        name: Name of the values in messages.
        function: The function.
        points: Points, shape (n, dim), [length].
        shape: Shape of one value: () or (dim,).

    Raises:
        InvalidInputError: If it returns another shape or something other than finite numbers.
        UserCodeError: If it raises.
    """
    with user_code(f"the function given as {name}"):
        values = finite_numbers(function(points.copy()))
    wanted = (len(points), *shape)
    if values is None or values.shape != wanted:
        given = "something other than finite numbers" if values is None else f"shape {values.shape}"
        raise InvalidInputError(
            f"the function given as {name} must return finite numbers of shape {wanted} for points of shape "
            f"{points.shape}, got {given}: it receives all points at once, one row each"
        )
    return values


def gradients_of(name: str, function: OfPosition, points: np.ndarray, shape: tuple[int, ...]) -> np.ndarray:
    """Return the gradients of a function of position by central differences.

    The step is 1e-5 of the extent of the points, at which the error of smooth functions is about 1e-10 of
    their values; at a kink the slope is the mean of both sides. The function is asked for at points that lie
    outside the body by one step.

    Args:
        name: Name of the values in messages.
        function: The function.
        points: Points, shape (n, dim), [length].
        shape: Shape of one value: () or (dim,).

    Returns:
        Shape ``(n, *shape, dim)``, the derivatives last.

    Raises:
        InvalidInputError: If it returns another shape or something other than finite numbers.
        UserCodeError: If it raises.
    """
    step = 1e-5 * (float(np.ptp(points, axis=0).max(initial=0.0)) or 1.0)
    beside = f"{name}, asked {step:.1e} beside the nodes for its gradient"
    columns = [
        evaluate(beside, function, points + way, shape) - evaluate(beside, function, points - way, shape)
        for way in step * np.eye(points.shape[1])
    ]
    return np.stack(columns, axis=-1) / (2.0 * step)
