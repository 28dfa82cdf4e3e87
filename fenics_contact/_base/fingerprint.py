"""Descriptions of problems that another run of the same script reproduces, the same on all ranks."""

from __future__ import annotations

import hashlib
from collections.abc import Callable, Mapping, Sequence
from dataclasses import fields, is_dataclass
from enum import Enum, IntEnum, StrEnum
from functools import partial, singledispatch
from pathlib import PurePath
from types import FunctionType, NoneType
from typing import TYPE_CHECKING, Any, TypeAlias

import numpy as np

from fenics_contact.errors import InvalidInputError, agree

if TYPE_CHECKING:
    from mpi4py import MPI


#: Largest number of differences in a message.
MOST_NAMED = 4


#: Words on a value and its parts by name.
Parts: TypeAlias = tuple[str, list[tuple[str, Any]]]


def described(value: Any, name: str) -> dict[str, str]:
    """Describe a value by its parts: one entry for each number, text or array.

    Arrays are described by shape, type and a hash of their bits, dataclasses, mappings and sequences by their
    contents, functions by their names and the values in their closures and defaults, classes by their names;
    any other object only by its class.

    Example:
        >>> described({"length": 2.0}, "beam")
        {'beam': '1 entries', "beam['length']": '2.0'}
    """
    parts: dict[str, str] = {}
    _describe(value, name, parts, (), _parts)
    return parts


def described_by_names(value: Any, name: str) -> dict[str, str]:
    """Describe a value as `described` does, but functions by their names alone."""
    parts: dict[str, str] = {}
    _describe(value, name, parts, (), _parts_but_of_functions)
    return parts


def differences(there: Mapping[str, str], here: Mapping[str, str]) -> list[str]:
    """Name the differences between two descriptions, the first few in full."""
    unlike = [name for name in {**there, **here} if there.get(name) != here.get(name)]
    named = [
        f"{name} ({there.get(name, 'absent')}, {here.get(name, 'absent')})" for name in unlike[:MOST_NAMED]
    ]
    more = len(unlike) - MOST_NAMED
    return [*named, f"{more} more"] if more > 0 else named


def _describe(
    value: Any,
    name: str,
    descriptions: dict[str, str],
    around: tuple[int, ...],
    parts_of: Callable[[Any, str], Parts],
) -> None:
    """Add the parts of a value, which is nested in the objects of these identities."""
    descriptions[name], parts = parts_of(value, name)
    if id(value) not in around:
        for part, inner in parts:
            _describe(inner, part, descriptions, (*around, id(value)), parts_of)


def _parts_but_of_functions(value: Any, name: str) -> Parts:
    words, parts = _parts(value, name)
    return words, [] if isinstance(value, FunctionType) else parts


@singledispatch
def _parts(value: Any, name: str) -> Parts:
    """Return the words on a value, and its parts."""
    if is_dataclass(value):
        return _class(value), [(f"{name}.{part.name}", getattr(value, part.name)) for part in fields(value)]
    if hasattr(value, "__qualname__"):
        return f"{value.__module__}.{value.__qualname__}", []
    return _class(value), []


_parts.register(type, lambda value, name: (f"{value.__module__}.{value.__qualname__}", []))
_kind: type
for _kind in (NoneType, str, bytes, int, float, complex, PurePath):
    _parts.register(_kind, lambda value, name: (repr(value), []))
for _kind in (np.generic, np.str_, np.bytes_):
    _parts.register(_kind, lambda value, name: (repr(value.item()), []))
for _kind in (Enum, IntEnum, StrEnum):
    _parts.register(_kind, lambda value, name: (f"{type(value).__name__}.{value.name}", []))


@_parts.register(np.ndarray)
def _(value: np.ndarray, name: str) -> Parts:
    digest = hashlib.sha256(_bits(value)).hexdigest()[:16]
    return f"{value.dtype} array of shape {value.shape}, sha256 {digest}", []


def _bits(value: np.ndarray) -> bytes | memoryview:
    """Return the bits of an array; of numbers without a copy."""
    array = np.ascontiguousarray(value)
    return array.reshape(-1).view(np.uint8).data if array.dtype.kind in "biufc" else array.tobytes()


@_parts.register(Mapping)
def _(value: Mapping[Any, Any], name: str) -> Parts:
    return f"{len(value)} entries", [(f"{name}[{key!r}]", part) for key, part in value.items()]


@_parts.register(Sequence)
def _(value: Sequence[Any], name: str) -> Parts:
    return f"{len(value)} entries", [(f"{name}[{index}]", part) for index, part in enumerate(value)]


@_parts.register(partial)
def _(value: partial[Any], name: str) -> Parts:
    return "partial", [(f"{name}.{part}", getattr(value, part)) for part in ("func", "args", "keywords")]


@_parts.register(FunctionType)
def _(value: FunctionType, name: str) -> Parts:
    cells = zip(value.__code__.co_freevars, value.__closure__ or (), strict=True)
    carried = [(f"{name}.{variable}", cell.cell_contents) for variable, cell in cells if _filled(cell)]
    given = [] if value.__defaults__ is None else [(f"{name}.defaults", value.__defaults__)]
    return f"{value.__module__}.{value.__qualname__}", [*carried, *given]


def _filled(cell: Any) -> bool:
    """Return whether a variable of an enclosing function has a value yet."""
    try:
        cell.cell_contents
    except ValueError:
        return False
    return True


def _class(value: Any) -> str:
    return f"{type(value).__module__}.{type(value).__qualname__}"


def require_alike(comm: MPI.Comm, descriptions: Mapping[str, str]) -> None:
    """Reject input, see `described`, that differs from rank to rank. Collective on ``comm``."""
    if comm.size == 1:
        return
    digest = hashlib.sha256(repr(list(descriptions.items())).encode()).digest()
    digests = comm.allgather(digest)
    other = next((rank for rank, each in enumerate(digests) if each != digests[0]), 0)
    if other == 0:
        return
    first = comm.bcast(dict(descriptions))
    named = comm.bcast(differences(first, descriptions) or [_order(first, descriptions)], root=other)
    error = InvalidInputError(
        f"all ranks must be given the same, but on rank 0 and rank {other} differ {'; '.join(named)}: build "
        "it from the same numbers on every rank, or on rank 0 alone and send it with comm.bcast"
    )
    agree(comm, error)


def _order(there: Mapping[str, str], here: Mapping[str, str]) -> str:
    """Describe where two descriptions differ in order."""
    pairs = zip(there, here, strict=True)
    one, other = next(((one, other) for one, other in pairs if one != other), ("", ""))
    return f"the order of entries ({one}, {other})"
