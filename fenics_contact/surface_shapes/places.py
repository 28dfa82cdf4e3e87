"""Checks of the position and size of shapes, with the class's name in messages."""

from __future__ import annotations

import numpy as np

from fenics_contact.checks import GivenVector
from fenics_contact.errors import InvalidInputError


def require_place(shape: object, point: GivenVector, dims: tuple[int, ...] = (2, 3)) -> None:
    """Reject a point without ``dim`` finite coordinates.

    Raises:
        InvalidInputError: Names the shape's class.
    """
    if len(point) not in dims or not np.all(np.isfinite(point)):
        needed = " or ".join(str(dim) for dim in dims)
        raise InvalidInputError(
            f"{type(shape).__name__} must be placed by {needed} finite numbers, got {point!r}: give the "
            "coordinates of a point"
        )


def require_radius(shape: object, radius: float, name: str = "radius") -> None:
    """Reject a radius that is not positive.

    Raises:
        InvalidInputError: Names the shape's class.
    """
    if not (np.isfinite(radius) and radius > 0):
        raise InvalidInputError(
            f"{type(shape).__name__}.{name} must be a positive number, got {radius!r}: for a socket or a "
            "hole give the positive radius and hollow=True"
        )


def outer(first: np.ndarray, second: np.ndarray) -> np.ndarray:
    """Return products a bᵀ of vectors in rows, (n, dim) -> (n, dim, dim)."""
    return np.asarray(first[:, :, None] * second[:, None, :])


def require_plane(shape: object, profile: object) -> None:
    """Reject a profile that is a shape in space.

    Raises:
        InvalidInputError: Names the shape's class and the profile's.
    """
    if getattr(profile, "dim", 2) != 2:
        raise InvalidInputError(
            f"{type(shape).__name__}.profile must be a shape in the plane, got a {type(profile).__name__} in "
            "space: place it by two coordinates"
        )
