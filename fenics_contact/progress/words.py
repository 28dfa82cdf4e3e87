"""Formatting of numbers and texts for readers."""

from __future__ import annotations

import re

#: Characters that a terminal interprets: control characters except newline and tab, line and paragraph
#: separators, changes of writing direction, surrogates.
_OBEYED = re.compile("[\x00-\x08\x0b-\x1f\x7f-\x9f\u2028\u2029\u202a-\u202e\u2066-\u2069\ud800-\udfff]")


def duration(seconds: float | None) -> str:
    """Format a duration: 0.4 s, 8 s, 3 min, 1.5 h.

    Args:
        seconds: The duration, None if unknown.
    """
    if seconds is None:
        return "?"
    if 0.05 <= seconds < 0.95:
        return f"{seconds:.1f} s"
    if seconds < 90.0:
        return f"{seconds:.0f} s"
    return f"{seconds / 60:.0f} min" if seconds < 5400.0 else f"{seconds / 3600:.1f} h"


def joined(*parts: str) -> str:
    """Join the non-empty parts by commas."""
    return ", ".join(part for part in parts if part)


def is_visible(text: str) -> bool:
    """Return whether a text contains no characters that a terminal interprets."""
    return not _OBEYED.search(text)


def visible(text: str) -> str:
    """Return a text with all characters that a terminal interprets as Python's escapes."""
    return _OBEYED.sub(lambda match: match.group().encode("unicode_escape").decode("ascii"), text)
