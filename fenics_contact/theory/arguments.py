"""Checks of the arguments of formulas."""

from __future__ import annotations

from typing import Any

import numpy as np

from fenics_contact.errors import InvalidInputError


def require_numbers(**given: Any) -> None:
    """Reject arguments, given by their names, that are not finite numbers."""
    for name, value in given.items():
        real = isinstance(value, int | float | np.integer | np.floating) and not isinstance(value, bool)
        if not (real and -np.inf < value < np.inf):
            raise InvalidInputError(f"{name} must be a finite number, got {value!r}: give another")


def require_positive(**given: Any) -> None:
    """Reject arguments, given by their names, that are not positive finite numbers."""
    require_numbers(**given)
    for name, value in given.items():
        if value <= 0.0:
            raise InvalidInputError(f"{name} must be positive, got {value}: give another")
