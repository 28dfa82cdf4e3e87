"""Result files, replaced atomically and written by one run at a time; JSON files.

A run holds a lock on a hidden file in its folder. The system releases the lock of a run that dies for any
reason; the remaining file blocks no other run.
"""

from __future__ import annotations

import errno
import json
import logging
import math
import os
import shutil
import socket
from collections.abc import Callable, Iterator, Mapping, Sequence
from contextlib import contextmanager, nullcontext, suppress
from dataclasses import fields, is_dataclass
from datetime import datetime
from enum import Enum, IntEnum, StrEnum
from functools import partial, singledispatch
from pathlib import Path
from types import NoneType
from typing import TYPE_CHECKING, Any

import numpy as np

from fenics_contact._base.checks import naming_arguments
from fenics_contact._base.display import in_short
from fenics_contact._base.files import Lock, hidden_folder, locked, replace_all
from fenics_contact._base.launching import ranks_of
from fenics_contact.errors import FenicsContactError, InvalidInputError, agree, together

if TYPE_CHECKING:
    from mpi4py import MPI


class OutputError(FenicsContactError, OSError):
    """A file could not be written; an existing one of its name is unchanged."""


@contextmanager
def replacing(*targets: Path) -> Iterator[tuple[Path, ...]]:
    """Yield hidden paths beside the targets, and move the written files there at the end.

    If the block raises, the targets are unchanged. Each file is replaced atomically. Of several the last must
    be one that refers to the others: it exists only while all the others do.
    """
    folder = targets[0].parent
    try:
        with hidden_folder(folder, targets[0].stem) as hidden:
            yield tuple(hidden / target.name for target in targets)
            replace_all([hidden / target.name for target in targets], folder)
    except OSError as error:
        raise _output_error(targets, error) from error


@naming_arguments
def write_text(path: Path, text: str) -> None:
    """Write a text file atomically; raises as `replacing` does."""
    with replacing(path) as (temporary,):
        temporary.write_text(text, encoding="utf-8")


def replacing_together(
    comm: MPI.Comm,
    targets: Sequence[Path],
    write: Callable[[Path], None],
    *,
    size: int,
    repair: Callable[[Path], None] | None = None,
) -> None:
    """Let all ranks write the same files, and move them to their targets when all are done. Collective."""
    with _on_first_rank(comm, targets[0]) as hidden:
        with together(comm):
            if comm.rank == 0:
                _require_room(targets, size)
        error: Exception | None = None
        try:
            write(hidden)
        except (OSError, RuntimeError) as caught:  # HDF5 reports a full disk in its own way
            error = _output_error(targets, caught)
        except Exception as caught:
            error = caught
        agree(comm, error)
        with together(comm):
            if comm.rank == 0:
                try:
                    if repair is not None:
                        repair(hidden)
                    replace_all([hidden / target.name for target in targets], targets[0].parent)
                except OSError as caught:
                    raise _output_error(targets, caught) from caught


def _require_room(targets: Sequence[Path], size: int) -> None:
    free = shutil.disk_usage(targets[0].parent).free
    if free < size:
        reason = f"{os.strerror(errno.ENOSPC)}: {size} bytes are needed, {free} are free"
        raise _output_error(targets, OSError(errno.ENOSPC, reason))


@contextmanager
def _on_first_rank(comm: MPI.Comm, target: Path) -> Iterator[Path]:
    """Create a hidden folder on rank 0 and broadcast its name. Collective."""
    owner = hidden_folder(target.parent, target.stem)
    name: Path | None = None
    with together(comm):
        try:
            name = owner.__enter__() if comm.rank == 0 else None
        except OSError as error:
            raise _output_error([target], error) from error
    try:
        yield comm.bcast(name)
    finally:
        if comm.rank == 0:
            owner.__exit__(None, None, None)


def _output_error(targets: Sequence[Path], error: Exception) -> OutputError:
    """Return the error that states which files could not be written, why, and what to do."""
    reason = (error.strerror if isinstance(error, OSError) else None) or str(error) or type(error).__name__
    names = ", ".join(repr(target.name) for target in targets[:3])
    more = f" and {len(targets) - 3} more" if len(targets) > 3 else ""
    return OutputError(
        f"{names}{more} could not be written to the folder {str(targets[0].parent)!r}: {reason}. What was "
        "there under these names is as it was: free space, make the folder writable or give another one"
    )


#: Largest number of entries of an array that a description lists.
SHOWN = 12


@naming_arguments
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
        if ranks_of(comm).rank == 0:
            write_text(target, json_text(data))
    return target


def json_text(data: Any) -> str:
    """Return data as the text of a JSON file; see `write_json`."""
    return json.dumps(plain(data), indent=2, ensure_ascii=False, allow_nan=False) + "\n"


class Strict:
    """JSON's types alone: all else is refused by its place."""

    def kind(self, data: Any) -> dict[str, str]:
        """Return what is said of a dataclass besides its fields."""
        return {}

    def key(self, key: Any, place: str) -> str:
        """Return a key."""
        if not isinstance(key, str):
            raise InvalidInputError(f"keys of {place} must be strings, got {key!r}: convert it first")
        return key

    def array(self, data: np.ndarray, place: str) -> Any:
        """Return an array."""
        return plain(data.tolist(), place, self)

    def infinite(self, data: float, place: str) -> None:
        """Return a number that is not finite."""
        raise InvalidInputError(f"{place} must be finite, got {data}, which JSON has not: write None")

    def other(self, data: Any, place: str) -> Any:
        """Return what has none of JSON's types."""
        raise InvalidInputError(
            f"{place} must be a mapping, sequence, string, number, bool, None or array, got "
            f"{type(data).__name__}"
        )


class Lenient(Strict):
    """Anything: large arrays in short, objects and functions by their names."""

    def kind(self, data: Any) -> dict[str, str]:
        """Return the class."""
        return {"type": type(data).__name__}

    def key(self, key: Any, place: str) -> str:
        """Return a key as text."""
        return str(key)

    def array(self, data: np.ndarray, place: str) -> Any:
        """Return an array, a large one in short."""
        return in_short(data) if data.size > SHOWN else super().array(data, place)

    def infinite(self, data: float, place: str) -> None:
        """Return None."""

    def other(self, data: Any, place: str) -> Any:
        """Return names."""
        return _named(data)


def plain(data: Any, place: str = "data", form: Strict = Strict()) -> Any:
    """Convert data to JSON's types."""
    if is_dataclass(data) and not isinstance(data, type):
        parts = {each.name: (getattr(data, each.name), f"{place}.{each.name}") for each in fields(data)}
        return form.kind(data) | {name: plain(*part, form) for name, part in parts.items()}
    return _plain(data, place, form)


@singledispatch
def _plain(data: Any, place: str, form: Strict) -> Any:
    return form.other(data, place)


_kind: type
for _kind in (Enum, IntEnum, StrEnum):
    _plain.register(_kind, lambda data, place, form: plain(data.value, place, form))
for _kind in (np.generic, np.str_, np.bytes_):
    _plain.register(_kind, lambda data, place, form: plain(data.tolist(), place, form))
for _kind in (NoneType, str, int):
    _plain.register(_kind, lambda data, place, form: data)
for _kind in (bytes, bytearray):
    _plain.register(_kind, _plain.dispatch(object))
_plain.register(np.ndarray, lambda data, place, form: form.array(data, place))
_plain.register(float, lambda data, place, form: data if math.isfinite(data) else form.infinite(data, place))
_plain.register(Path, lambda data, place, form: str(data))


@_plain.register(Mapping)
def _(data: Mapping[Any, Any], place: str, form: Strict) -> dict[str, Any]:
    return {form.key(key, place): plain(value, f"{place}[{key!r}]", form) for key, value in data.items()}


@_plain.register(Sequence)
def _(data: Sequence[Any], place: str, form: Strict) -> list[Any]:
    return [plain(value, f"{place}[{index}]", form) for index, value in enumerate(data)]


def _named(data: Any) -> dict[str, str]:
    """Describe a function by its name, any other object by its type."""
    if isinstance(data, partial):
        return _named(data.func)
    return {"function": data.__qualname__} if hasattr(data, "__qualname__") else {"type": type(data).__name__}


#: Name of the lock file.
LOCK = ".fenics_contact.lock"

_LOG = logging.getLogger(__name__)


@contextmanager
def only_run_in(folder: str | Path, comm: MPI.Comm) -> Iterator[None]:
    """Keep other runs out of a folder while the block writes its results there. Collective on ``comm``.

    Rank 0 holds the lock, all ranks learn whether there is another run. On a file system without locks no run
    is excluded, which is logged.

    Args:
        folder: Folder of the results; created, and removed again if nothing was written.
        comm: Communicator of the run.

    Raises:
        InvalidInputError: On all ranks, if another run writes to the folder; states which.
        OutputError: On all ranks, if the folder cannot be made or written to.

    Example:
        >>> with only_run_in("output", comm):  # doctest: +SKIP
        ...     write_result(solve_scene(scene, comm), "output")
    """
    path, lock, made = Path(folder) / LOCK, None, False
    with together(comm):
        if comm.rank == 0:
            try:
                made = not path.parent.is_dir()
                path.parent.mkdir(parents=True, exist_ok=True)
                lock = _taken(path)
            except InvalidInputError:
                raise
            except (OSError, ValueError) as error:
                reason = getattr(error, "strerror", None) or error
                raise OutputError(
                    f"results cannot be written to the folder {str(folder)!r}: {reason}. Make it writable"
                ) from error
    try:
        yield
    finally:
        if lock is not None:
            path.unlink(missing_ok=True)
            lock.close()
        if made:
            with suppress(OSError):  # not empty: something was written
                path.parent.rmdir()


def _taken(path: Path) -> Lock | None:
    """Lock a file, created if necessary; None where there are no locks."""
    while True:
        path.touch()
        with suppress(FileNotFoundError):  # its owner has removed it since
            lock = locked(path)
            if not lock.known:
                lock.close()
                path.unlink(missing_ok=True)
                _LOG.warning("%s: no locks there, let no other run write to this folder", path.parent)
                return None
            if not lock.taken:
                lock.close()
                owner = path.read_text(encoding="utf-8", errors="replace").strip()
                raise InvalidInputError(
                    f"a folder must have one run at a time, another one ({owner or 'just begun'}) writes to "
                    f"{str(path.parent)!r}: wait for its end, or give this run another folder"
                )
            if path.exists() and os.path.samestat(os.fstat(lock.descriptor), path.stat()):
                begun = datetime.now().astimezone().isoformat(" ", "seconds")
                path.write_text(f"process {os.getpid()} on {socket.gethostname()}, begun {begun}")
                return lock
            lock.close()
