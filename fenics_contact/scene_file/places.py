"""Keys of a scene file as paths, and as text."""

from __future__ import annotations

import re
from collections.abc import Iterator, Mapping, Sequence
from typing import Any, TypeAlias

import tomlkit
import tomlkit.items
from pydantic import BaseModel

from fenics_contact.progress import visible

#: Keys and positions from the top of the file: ("contacts", 0, "friction").
Path: TypeAlias = tuple[str | int, ...]

#: Largest length of a value in messages.
LONGEST = 60
_MOST_BITS = 3322
_BARE = re.compile(r"[A-Za-z0-9_-]+")


def written(path: Path) -> str:
    """Return a path in the form of `--set`: ``contacts.0.friction``."""
    return ".".join(
        str(part) if isinstance(part, int) or _BARE.fullmatch(part) else f'"{shortened(visible(part))}"'
        for part in path
    )


def shortened(text: str) -> str:
    """Return a text, cut to the length allowed in messages."""
    return text if len(text) <= LONGEST else f"{text[: LONGEST - 3]}..."


def as_toml(value: Any) -> str:
    """Return a value in TOML's form, shortened if it is long."""
    if isinstance(value, Mapping):
        text = f"a table with {', '.join(map(str, value))}" if value else "an empty table"
    elif value is None:
        text = "nothing"
    else:
        text = _as_toml(value)
    return shortened(visible(" ".join(text.split())))


def _as_toml(value: Any) -> str:
    if isinstance(value, str | list | tuple):
        value = value[:LONGEST]
    if isinstance(value, int) and value.bit_length() > _MOST_BITS:
        return "an integer of more than 1000 digits"  # Python refuses to convert it
    try:
        return tomlkit.item(value).as_string()
    except (TypeError, ValueError):
        return repr(value)


def branches(data: Any, path: Path = ()) -> Iterator[tuple[Path, Any]]:
    """Yield plain data or a table and everything in it, with paths."""
    waiting = [(path, data)]
    while waiting:  # data may be nested deeper than Python's recursion limit
        path, data = waiting.pop()
        yield path, data
        inner: Any = ()
        if isinstance(data, list | tuple):
            inner = enumerate(data)
        elif isinstance(data, Mapping | BaseModel):
            inner = data.items() if isinstance(data, Mapping) else data
        waiting += [((*path, key), part) for key, part in inner]


def value_at(data: Any, path: Path) -> Any:
    """Return the value at a path; None if there is none."""
    for part in path:
        try:
            data = data[part]
        except (KeyError, IndexError, TypeError):
            return None
    return data


def replaced(data: Any, path: Path, value: Any) -> Any:
    """Return a copy of the data with another value at a path.

    Raises:
        KeyError: If a list on the path has no such entry, or a value on the path has no keys.
    """
    if not path:
        return value
    first, rest = path[0], path[1:]
    if isinstance(data, Mapping):
        return {**data, str(first): replaced(data.get(str(first), {}), rest, value)}
    if isinstance(data, Sequence) and not isinstance(data, str):
        if not str(first).isdecimal() or int(first) >= len(data):
            raise KeyError(f"{first} of {len(data)} entries, numbered from 0")
        changed = list(data)
        changed[int(first)] = replaced(data[int(first)], rest, value)
        return changed
    raise KeyError(f"{first}, but there is {as_toml(data)}")
