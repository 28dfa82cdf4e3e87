"""On which line of a TOML text a key stands."""

from __future__ import annotations

import tomllib
from bisect import bisect_left
from typing import Any

import tomlkit
import tomlkit.exceptions

from fenics_contact.scene_file.places import Path, value_at

_MARK = "\u241f"  # stands in no file


def line_of(text: str, path: Path) -> int:
    """Return the line, from 1, on which a key or table of a TOML text begins.

    A key that is not there is looked for at the nearest table around it.

    Args:
        text: A text that is TOML.
        path: Keys and positions from its top.

    Returns:
        The line; 0 where nothing on the way to the key is there.
    """
    whole = tomllib.loads(text)
    while path and value_at(whole, path) is None:
        path = path[:-1]
    if not path:
        return 0
    lines = text.splitlines(keepends=True)
    # The first lines of a text are TOML wherever a statement ends, and from the key's own on they hold it.
    end = bisect_left(range(len(lines)), True, key=lambda count: _holds(lines, count + 1, path)) + 1
    start = end - 1
    while start > 0 and _parsed("".join(lines[:start])) is None:
        start -= 1
    return start + _within("".join(lines[start:]), path) + 1


def _parsed(text: str) -> dict[str, Any] | None:
    try:
        return tomllib.loads(text)
    except tomllib.TOMLDecodeError:
        return None


def _holds(lines: list[str], count: int, path: Path) -> bool:
    """Tell whether the statement that ends on or after a line, or one before it, holds a key."""
    for stop in range(count, len(lines) + 1):
        data = _parsed("".join(lines[:stop]))
        if data is not None:
            return value_at(data, path) is not None
    return True


def _within(text: str, path: Path) -> int:
    """Return how many lines below the beginning of its statement a key stands, inside of brackets.

    The key is marked in a copy of the statement, whose text first differs there.
    """
    statement = ""
    for line in text.splitlines(keepends=True):
        statement += line
        if _parsed(statement) is not None:
            break
    if statement.lstrip().startswith("["):
        return 0  # the head of a table
    document = tomlkit.parse(statement)
    for inner in (path[first:] for first in range(len(path))):
        if value_at(document, inner) is None:
            continue
        try:
            value_at(document, inner[:-1])[inner[-1]] = _MARK
        except (tomlkit.exceptions.TOMLKitError, TypeError, ValueError):
            return 0
        marked = tomlkit.dumps(document)
        differing = (
            at for at, (one, other) in enumerate(zip(statement, marked, strict=False)) if one != other
        )
        return statement.count("\n", 0, next(differing, 0))
    return 0
