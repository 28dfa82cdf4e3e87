"""Checks of numbers and names that parts of a scene have in common; each part gives its own remedy."""

from __future__ import annotations

from collections.abc import Collection, Mapping, Sequence
from sys import float_info
from typing import Any

import numpy as np

from fenics_contact._base.checks import GivenVector, floats
from fenics_contact.errors import InvalidInputError


def check_positive(name: str, given: float, remedy: str) -> None:
    """Reject a number that is not above zero and finite."""
    if not 0.0 < given < np.inf:
        raise InvalidInputError(f"{name} must be positive and finite, got {given!r}: {remedy}")


def check_not_negative(name: str, given: float, remedy: str) -> None:
    """Reject a number that is negative or not finite."""
    if not 0.0 <= given < np.inf:
        raise InvalidInputError(f"{name} must be zero or positive and finite, got {given!r}: {remedy}")


def plain_numbers(given: float | Sequence[float] | np.ndarray) -> Any:
    """Return a number or a row of numbers as plain ones."""
    numbers = np.asarray(given, dtype=np.float64)
    return floats(numbers) if numbers.ndim else float(numbers)


def checked_stiffness(
    name: str, given: float | Sequence[float], remedy: str, largest: float = float_info.max
) -> Any:
    """Return a stiffness, or those along the axes, as plain numbers; reject what holds nothing."""
    numbers = np.asarray(given, dtype=np.float64)
    if not ((numbers >= 0.0) & (numbers <= largest)).all() or not numbers.any():
        needed = "must be positive, or numbers of at least zero along the axes"
        raise InvalidInputError(f"{name} {needed}, got {given!r}: {remedy}")
    return plain_numbers(numbers)


def checked_point(name: str, given: GivenVector, remedy: str) -> GivenVector:
    """Return a point as plain numbers."""
    if len(given) not in (2, 3) or not np.isfinite(given).all():
        needed = "must be three finite coordinates (two in the plane)"
        raise InvalidInputError(f"{name} {needed}, got {given!r}: {remedy}")
    return floats(np.asarray(given, dtype=np.float64))


def check_entries(
    name: str, given: Sequence[float], count: int, remedy: str, kind: str = "coordinates"
) -> None:
    """Reject a vector of another space than that of its body."""
    if len(given) != count:
        raise InvalidInputError(f"{name} must have {count} {kind}, got {given!r}: {remedy}")


def check_known(name: object, known: Collection[Any], words: str, remedy: str = "use one of them") -> None:
    """Reject a name that is not there; `words`: who gives it, and what has the known ones."""
    if name not in known:
        raise InvalidInputError(f"{words} {sorted(known) or 'none'}: {remedy}")


def check_alike(what: str, given: Mapping[str, bool], remedy: str) -> None:
    """Reject a scene in which only some bodies, by name, are what all must be or none."""
    some, others = ([name for name in given if given[name] is which] for which in (True, False))
    if some and others:
        words = f"all bodies of a scene must {what} or none, got {some} but not {others}"
        raise InvalidInputError(f"{words}: {remedy}")
