"""Vectors that a user gives: two or three finite numbers."""

from __future__ import annotations

from typing import TypeAlias

import numpy as np

from fenics_contact.errors import InvalidInputError

#: A vector as a user gives it.
GivenVector: TypeAlias = tuple[float, ...]


def floats(values: np.ndarray) -> GivenVector:
    """Return the entries of an array of one dimension as a user would give them."""
    return tuple(float(value) for value in values)


def unit_vector(name: str, value: GivenVector, dim: int) -> GivenVector:
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
    return floats(np.asarray(value) / length)
