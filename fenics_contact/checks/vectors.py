"""Vectors given by users: two or three finite numbers."""

from __future__ import annotations

from typing import TypeAlias

import numpy as np

from fenics_contact.errors import InvalidInputError

#: A vector given by a user.
GivenVector: TypeAlias = tuple[float, ...]


def floats(values: np.ndarray) -> GivenVector:
    """Return the entries of a one-dimensional array as plain numbers."""
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
