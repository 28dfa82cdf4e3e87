"""Numbers as readers want them."""

from __future__ import annotations


def duration(seconds: float | None) -> str:
    """Write a duration for readers: 0.4 s, 8 s, 3 min, 1.5 h.

    Args:
        seconds: The duration, None where nobody knows.
    """
    if seconds is None:
        return "?"
    if 0.05 <= seconds < 0.95:
        return f"{seconds:.1f} s"
    if seconds < 90.0:
        return f"{seconds:.0f} s"
    return f"{seconds / 60:.0f} min" if seconds < 5400.0 else f"{seconds / 3600:.1f} h"


def joined(*parts: str) -> str:
    """Join the parts that say something by commas."""
    return ", ".join(part for part in parts if part)


def scientific(value: float) -> str:
    """Write a tolerance as briefly as two digits allow: 1e-06, 2.5e-03."""
    return f"{value:.1e}".replace(".0e", "e")
