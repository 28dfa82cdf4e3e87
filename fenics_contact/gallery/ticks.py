"""Ends of cells that grow away from where they are small."""

from __future__ import annotations

import numpy as np

from fenics_contact.checks import check_numbers
from fenics_contact.errors import InvalidInputError
from fenics_contact.gallery.memory import require_room


def growing_ticks(length: float, first: float, ratio: float) -> np.ndarray:
    """Divide a length into cells of which each is longer than the one before by the same ratio.

    For `box_lattice` and `rectangle_lattice`, whose lines may be put together of such pieces.

    Args:
        length: Length, [length].
        first: Length of the first cell, which is made shorter so that they fit, [length].
        ratio: Length of a cell by that of the one before.

    Returns:
        Ascending ticks from 0 to ``length``, shape (n + 1,).

    Raises:
        InvalidInputError: If a length is not positive, cells do not grow, or they are too many.
    """
    check_numbers(length=length, first=first, ratio=ratio)
    if min(length, first) <= 0.0 or ratio <= 1.0:
        raise InvalidInputError(
            f"length and first must be positive and ratio greater than 1, got {length}, {first} and {ratio}: "
            "for cells of one length take numpy.linspace"
        )
    count = int(np.ceil(np.log1p(length * (ratio - 1.0) / first) / np.log(ratio)))
    require_room(count, 1)
    ends = np.cumsum(np.append(0.0, ratio ** np.arange(count)))
    return np.asarray(length * ends / ends[-1], dtype=np.float64)
