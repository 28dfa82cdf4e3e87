"""How accurately a state is solved: to a number, or as accurately as its mesh deserves."""

from __future__ import annotations

from typing import TYPE_CHECKING, TypeAlias

import numpy as np

from fenics_contact.errors import InvalidInputError

if TYPE_CHECKING:
    from fenics_contact.accuracy import BalancedTolerance

#: A largest relative residual, a share of the discretisation error, or None for the default.
Tolerance: TypeAlias = "float | BalancedTolerance | None"


def checked_tolerance(tolerance: object) -> float | BalancedTolerance | None:
    """Return a valid tolerance.

    Raises:
        InvalidInputError: If it is neither a number between 0 and 1 nor `BalancedTolerance`.
    """
    if tolerance is None:
        return None
    if isinstance(tolerance, float | int | np.floating):
        if 0.0 < tolerance < 1.0:
            return float(tolerance)
        raise InvalidInputError(
            f"tolerance must lie between 0 and 1, got {float(tolerance):g}: it is a relative residual, "
            "1e-6 is a good one"
        )
    from fenics_contact.accuracy import BalancedTolerance  # imported already if one was given

    if isinstance(tolerance, BalancedTolerance):
        return tolerance
    raise InvalidInputError(
        f"tolerance must be a number, BalancedTolerance(...) or None, got {type(tolerance).__name__}: give a "
        "relative residual such as 1e-6, or leave it out"
    )
