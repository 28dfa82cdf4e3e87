"""What a problem is, in words that another run of the same script finds again."""

from __future__ import annotations

import hashlib
from collections.abc import Mapping, Sequence
from dataclasses import fields, is_dataclass
from enum import Enum
from pathlib import PurePath
from typing import Any

import numpy as np

#: How many differences a message lists.
MOST_NAMED = 4


def described(value: Any, name: str) -> dict[str, str]:
    """Describe a value by its parts: one entry for each number, text or array.

    Arrays are described by shape, type and a hash of their bits, dataclasses, mappings and sequences by what
    they hold, functions and classes by their names; of any other object only the class is told.

    Args:
        value: What is to be recognised.
        name: How it is called.

    Example:
        >>> described({"length": 2.0}, "beam")
        {"beam['length']": '2.0'}
    """
    if isinstance(value, np.ndarray):
        digest = hashlib.sha256(np.ascontiguousarray(value).tobytes()).hexdigest()[:16]
        return {name: f"{value.dtype} array of shape {value.shape}, sha256 {digest}"}
    if isinstance(value, np.generic):
        value = value.item()
    if isinstance(value, Enum):
        return {name: f"{type(value).__name__}.{value.name}"}
    if value is None or isinstance(value, str | bytes | bool | int | float | complex | PurePath):
        return {name: repr(value)}
    if is_dataclass(value) and not isinstance(value, type):
        parts = [(f"{name}.{field.name}", getattr(value, field.name)) for field in fields(value)]
        return _joined({name: _class(value)}, parts)
    if isinstance(value, Mapping):
        return _joined({}, [(f"{name}[{key!r}]", part) for key, part in value.items()])
    if isinstance(value, Sequence):
        parts = [(f"{name}[{index}]", part) for index, part in enumerate(value)]
        return _joined({f"len({name})": str(len(value))}, parts)
    if hasattr(value, "__qualname__"):
        return {name: f"{value.__module__}.{value.__qualname__}"}
    return {name: _class(value)}


def differences(there: Mapping[str, str], here: Mapping[str, str]) -> list[str]:
    """Name what differs between two descriptions, the first few in words.

    Args:
        there: The one that was stored.
        here: The present one.
    """
    unlike = [name for name in {**there, **here} if there.get(name) != here.get(name)]
    named = [
        f"{name} ({there.get(name, 'absent')}, {here.get(name, 'absent')})" for name in unlike[:MOST_NAMED]
    ]
    more = len(unlike) - MOST_NAMED
    return [*named, f"{more} more"] if more > 0 else named


def _joined(first: dict[str, str], parts: list[tuple[str, Any]]) -> dict[str, str]:
    found = dict(first)
    for name, part in parts:
        found.update(described(part, name))
    return found


def _class(value: Any) -> str:
    return f"{type(value).__module__}.{type(value).__qualname__}"
