"""The protocol of a surface's true shape, and its checked evaluation."""

from __future__ import annotations

from typing import Literal, Protocol, TypeAlias, runtime_checkable

import numpy as np

from fenics_contact.errors import InvalidInputError, user_code


@runtime_checkable
class SurfaceShape(Protocol):
    """The true surface of a body, given by its signed distance; write a class with these members to add one.

    A class for only one dimension declares it by an attribute ``dim``.
    """

    def distance(self, points: np.ndarray) -> np.ndarray:
        """Return the signed distance, negative inside the body, (n, dim) -> (n,), [length]."""

    def normals(self, points: np.ndarray) -> np.ndarray:
        """Return the gradient of the distance, which points out of the body, (n, dim) -> (n, dim)."""

    def curvatures(self, points: np.ndarray) -> np.ndarray:
        """Return the second derivatives of the distance, (n, dim) -> (n, dim, dim), [1 / length]."""


Quantity: TypeAlias = Literal["distance", "normals", "curvatures"]


def evaluate_shape(shape: SurfaceShape, what: Quantity, points: np.ndarray) -> np.ndarray:
    """Evaluate a member of a shape, and check the result.

    Args:
        shape: The shape of a surface, or a rigid obstacle.
        what: Name of the member.
        points: Points, shape (n, dim), [length].

    Returns:
        The result, shape (n,), (n, dim) or (n, dim, dim).

    Raises:
        InvalidInputError: If the result has another shape or is not finite.
        UserCodeError: If it raises.
    """
    name = f"the {what} of {type(shape).__name__}"
    with user_code(name):
        values = np.asarray(getattr(shape, what)(points), dtype=np.float64)
    order = ("distance", "normals", "curvatures").index(what)
    needed = (len(points), *[points.shape[1]] * order)
    if values.shape != needed or not np.isfinite(values).all():
        given = f"shape {values.shape}" if values.shape != needed else "NaN or infinity"
        raise InvalidInputError(
            f"{name} must be finite numbers of shape {needed} for points of shape {points.shape}, got "
            f"{given}: it receives all points at once, one row each"
        )
    return values
