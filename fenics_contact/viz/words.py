"""Formatting of numbers and titles."""

from __future__ import annotations

import numpy as np

from fenics_contact.errors import InvalidInputError


def checked_range(clim: tuple[float, float]) -> tuple[float, float]:
    """Return a colour range if it is finite and not empty, else raise."""
    low, high = (float(value) for value in clim)
    if not (np.isfinite(low) and np.isfinite(high) and low < high):
        raise InvalidInputError(
            f"clim must be a finite range (low, high) with low < high, got {clim}: widen it"
        )
    return low, high


def written(value: float, digits: int = 4) -> str:
    """Format a number: 79 713, −0.138, 1.2e−05, with separated thousands and a true minus sign."""
    size = abs(value)
    if isinstance(value, int | np.integer):
        text = f"{value:,}"
    elif size == 0 or 1e-3 <= size < 1e7:
        decimals = digits - 1 - int(np.floor(np.log10(size))) if size else 0
        text = f"{round(value, decimals):,.{max(0, decimals)}f}"
    else:
        text = f"{value:.{digits - 1}e}"
    return text.replace(",", "\u202f").replace("-", "\u2212")


def checked_reach(reach: float | None) -> None:
    """Reject an extent of a picture that is not positive."""
    if reach is not None and not 0 < reach < np.inf:
        raise InvalidInputError(f"reach must be positive, got {reach}: leave it out to have it chosen")


def nice_number(value: float) -> float:
    """Round down to 1, 2 or 5 times a power of ten; 1 for non-positive values."""
    if not value > 0:
        return 1.0
    power = 10.0 ** np.floor(np.log10(value))
    return float(power * max(step for step in (1.0, 2.0, 5.0) if step * power <= value * (1 + 1e-9)))


def change(first: float, last: float) -> str:
    """Return "first → last" with the relative change."""
    words = f"{written(first, 6)} → {written(last, 6)}"
    if first == 0:
        return words
    return words + f", {100 * abs((last - first) / first):.2f} % {'lower' if last <= first else 'higher'}"


def headline(title: str, facts: str) -> str:
    """Return "title: facts", or the capitalised facts without a title."""
    return f"{title}: {facts}" if title else facts[:1].upper() + facts[1:]
