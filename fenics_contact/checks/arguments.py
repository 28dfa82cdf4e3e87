"""Numbers that meshes are built from: what is none is refused by its name."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import numpy as np

from fenics_contact.errors import InvalidInputError

#: Largest number of cells in a row, and of all else that is counted: more is a slip of the pen.
MOST = 1_000_000
#: Coordinates and sizes lie below: their products, and the squares of these, must be numbers, too.
LARGEST = 1e60
#: Largest logarithm of the ratio of two cells of one mesh.
STEEPEST = 8.0


def check_count(value: int, name: str, least: int = 1) -> None:
    """Refuse a count that is not an integer from ``least`` to `MOST`."""
    if not isinstance(value, int | np.integer) or isinstance(value, bool) or value < least:
        raise InvalidInputError(
            f"{name} must be an integer of at least {least}, got {brief(value)}: choose another count"
        )
    if value > MOST:
        raise InvalidInputError(f"{name} must be at most {MOST}, got {brief(value)}: choose a smaller count")


def check_numbers(**given: Any) -> None:
    """Refuse arguments, given by their names, that are no finite numbers, or too large to be multiplied."""
    for name, value in given.items():
        if not _is_number(value):
            raise InvalidInputError(
                f"{name} must be a finite number of less than {LARGEST:g}, got {brief(value)}: give another"
            )


def check_grading(value: Any) -> None:
    """Refuse a logarithm of the ratio of two cells of one mesh that is negative or too large for it."""
    check_numbers(grading=value)
    if not 0.0 <= value <= STEEPEST:
        raise InvalidInputError(
            f"grading must lie between 0 and 8, got {value}: 0 gives equal cells, 3 makes the smallest 20 "
            "times smaller than the largest"
        )


def check_row(values: Any, name: str, count: int) -> None:
    """Refuse what is not a sequence of so many finite numbers."""
    known = isinstance(values, Sequence | np.ndarray) and np.ndim(values) == 1 and len(values) == count
    if not known or not all(map(_is_number, values)):
        raise InvalidInputError(
            f"{name} must be {count} finite numbers of less than {LARGEST:g}, got {brief(values)}: give them"
        )


def brief(value: Any) -> str:
    """Return a value as messages repeat it, also an integer that Python refuses to write."""
    if isinstance(value, int) and value.bit_length() > 100:
        return "an integer of more than thirty digits"
    try:
        text = repr(value)
    except ValueError:  # of such an integer inside of it
        return f"a {type(value).__name__} of very large integers"
    return text if len(text) <= 200 else f"{text[:197]}..."


def _is_number(value: Any) -> bool:
    real = isinstance(value, int | float | np.integer | np.floating) and not isinstance(value, bool)
    return real and -LARGEST < value < LARGEST
