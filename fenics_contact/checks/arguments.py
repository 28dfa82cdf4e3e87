"""Checks of the numbers from which meshes are built, with the argument's name in messages."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import numpy as np

from fenics_contact.errors import InvalidInputError

#: Largest number of cells in a row, and of any other count: more is a typing error.
MOST = 1_000_000
#: Bound on coordinates and sizes: their products, and the squares of these, must be finite, too.
LARGEST = 1e60
#: Largest logarithm of the ratio of two cells of one mesh.
STEEPEST = 8.0


def check_count(value: int, name: str, least: int = 1) -> None:
    """Reject a count that is not an integer from ``least`` to `MOST`."""
    if not isinstance(value, int | np.integer) or isinstance(value, bool) or value < least:
        raise InvalidInputError(
            f"{name} must be an integer of at least {least}, got {brief(value)}: choose another count"
        )
    if value > MOST:
        raise InvalidInputError(f"{name} must be at most {MOST}, got {brief(value)}: choose a smaller count")


def check_numbers(**given: Any) -> None:
    """Reject arguments, given by their names, that are not finite numbers, or too large to be multiplied."""
    for name, value in given.items():
        if not _is_number(value):
            raise InvalidInputError(
                f"{name} must be a finite number of less than {LARGEST:g}, got {brief(value)}: give another"
            )


def check_grading(value: Any) -> None:
    """Reject a grading, the logarithm of a ratio of cells of one mesh, that is negative or too large."""
    check_numbers(grading=value)
    if not 0.0 <= value <= STEEPEST:
        raise InvalidInputError(
            f"grading must lie between 0 and 8, got {value}: 0 gives equal cells, 3 makes the smallest 20 "
            "times smaller than the largest"
        )


def check_row(values: Any, name: str, count: int) -> None:
    """Reject a value that is not a sequence of ``count`` finite numbers."""
    known = isinstance(values, Sequence | np.ndarray) and np.ndim(values) == 1 and len(values) == count
    if not known or not all(map(_is_number, values)):
        raise InvalidInputError(
            f"{name} must be {count} finite numbers of less than {LARGEST:g}, got {brief(values)}: give them"
        )


def brief(value: Any) -> str:
    """Return a value for messages, also an integer that Python refuses to convert to text."""
    if isinstance(value, int) and value.bit_length() > 100:
        return "an integer of more than thirty digits"
    try:
        text = repr(value)
    except ValueError:  # such an integer inside it
        return f"a {type(value).__name__} of very large integers"
    return text if len(text) <= 200 else f"{text[:197]}..."


def _is_number(value: Any) -> bool:
    real = isinstance(value, int | float | np.integer | np.floating) and not isinstance(value, bool)
    return real and -LARGEST < value < LARGEST
