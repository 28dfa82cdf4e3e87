"""Vectors that a user gives: two or three finite numbers."""

from __future__ import annotations

from typing import TypeAlias

import numpy as np

from fenics_contact.errors import InvalidInputError

Vector: TypeAlias = tuple[float, ...]


def unit_vector(name: str, value: Vector, dim: int) -> Vector:
    """Return a direction at unit length.

    Raises:
        InvalidInputError: If it does not have ``dim`` finite entries or is zero.
    """
    length = float(np.linalg.norm(value)) if len(value) == dim else 0.0
    if not (np.isfinite(length) and length > 0):
        raise InvalidInputError(
            f"{name} must be {dim} finite numbers, not all zero, got {value!r}: for a floor in space give "
            "(0, 0, 1)"
        )
    return tuple(float(component / length) for component in value)
