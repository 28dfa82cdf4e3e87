"""JSON files of results; NumPy's types are converted, numbers that JSON lacks are rejected."""

from __future__ import annotations

import json
import math
from collections.abc import Mapping, Sequence
from contextlib import nullcontext
from dataclasses import fields, is_dataclass
from enum import Enum
from functools import partial
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from fenics_contact.display import in_short
from fenics_contact.errors import InvalidInputError, together
from fenics_contact.io.replacing import write_text

if TYPE_CHECKING:
    from mpi4py import MPI

#: Largest number of entries of an array that a description lists.
SHOWN = 12


def write_json(path: str | Path, data: Any, *, comm: MPI.Comm | None = None) -> Path:
    """Write data to a JSON file, indented, with the keys in the order given.

    Args:
        path: File to write; its folder is created. A file of that name is replaced when the new one is
            complete.
        data: Mappings, sequences, strings, numbers, booleans and None; also NumPy's arrays and numbers,
            paths, dataclasses (by their fields) and enumerations (by their values).
        comm: If given, only rank 0 writes, and an error is raised on all ranks.

    Returns:
        The path.

    Raises:
        InvalidInputError: If a number is NaN or infinite or something has no counterpart in JSON; states
            where.

    Note:
        Collective on ``comm`` if given.

    Example:
        >>> write_json("result.json", {"objective": np.float64(-1.5), "force": np.zeros(3)})  # doctest: +SKIP
    """
    target = Path(path)
    with nullcontext() if comm is None else together(comm):
        if comm is None or comm.rank == 0:
            write_text(target, json_text(data))
    return target


def json_text(data: Any) -> str:
    """Return data as the text of a JSON file; see `write_json`."""
    return json.dumps(plain(data), indent=2, ensure_ascii=False, allow_nan=False) + "\n"


def plain(data: Any, place: str = "data", *, lenient: bool = False) -> Any:
    """Convert data to JSON's types.

    Raises:
        InvalidInputError: If some part cannot be converted; states which.
    """

    def inside(part: Any, where: str) -> Any:
        return plain(part, f"{place}{where}", lenient=lenient)

    if isinstance(data, Enum):
        return inside(data.value, "")
    if is_dataclass(data) and not isinstance(data, type):
        kind = {"type": type(data).__name__} if lenient else {}
        return kind | {part.name: inside(getattr(data, part.name), f".{part.name}") for part in fields(data)}
    if lenient and isinstance(data, np.ndarray) and data.size > SHOWN:
        return in_short(data)
    if isinstance(data, np.ndarray | np.generic):
        return inside(data.tolist(), "")
    if isinstance(data, Mapping):
        return {_key(key, place, lenient): inside(value, f"[{key!r}]") for key, value in data.items()}
    if isinstance(data, float) and not math.isfinite(data) and not lenient:
        raise InvalidInputError(
            f"{place} must be finite, got {data}: JSON has no such number; leave it out or write None"
        )
    if isinstance(data, float):
        return data if math.isfinite(data) else None
    if data is None or isinstance(data, str | bool | int):
        return data
    if isinstance(data, Path):
        return str(data)
    if isinstance(data, Sequence) and not isinstance(data, bytes | bytearray):
        return [inside(value, f"[{index}]") for index, value in enumerate(data)]
    if lenient:
        return _named(data)
    raise InvalidInputError(
        f"{place} must be a mapping, sequence, string, number, truth value, None or array, got a "
        f"{type(data).__name__}: convert it first"
    )


def _key(key: Any, place: str, lenient: bool) -> str:
    if not isinstance(key, str) and not lenient:
        raise InvalidInputError(f"keys of {place} must be strings, got {key!r}: convert it first")
    return str(key)


def _named(data: Any) -> dict[str, str]:
    """Describe a function by its name, any other object by its type."""
    if isinstance(data, partial):
        return _named(data.func)
    return {"function": data.__qualname__} if hasattr(data, "__qualname__") else {"type": type(data).__name__}
