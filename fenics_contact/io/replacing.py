"""Atomic replacement of result files, also of several at once, written by one rank or by all."""

from __future__ import annotations

import errno
import os
import shutil
from collections.abc import Callable, Iterator, Sequence
from contextlib import contextmanager
from pathlib import Path
from typing import TYPE_CHECKING

from fenics_contact.checkpoint import hidden_folder, replace_all
from fenics_contact.errors import FenicsContactError, agree, together

if TYPE_CHECKING:
    from mpi4py import MPI


class OutputError(FenicsContactError, OSError):
    """A file could not be written; an existing one of its name is unchanged."""


@contextmanager
def replacing(*targets: Path) -> Iterator[tuple[Path, ...]]:
    """Yield paths to write to, and move the written files to the targets at the end.

    If the block raises, the targets are unchanged. Each file is replaced atomically. Of several the last must
    be one that refers to the others: it exists only while all the others do.

    Yields:
        For every target a path of the same name in a hidden folder beside it.

    Raises:
        OutputError: If the disk is full or the folder cannot be written to; says what to do.
    """
    folder = targets[0].parent
    try:
        with hidden_folder(folder, targets[0].stem) as hidden:
            yield tuple(hidden / target.name for target in targets)
            replace_all([hidden / target.name for target in targets], folder)
    except OSError as error:
        raise _output_error(targets, error) from error


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
    """Let all ranks write the same files, and move them to their targets when all are done. Collective.

    Raises:
        OutputError: On all ranks, if the disk is full or the folder cannot be written to.
    """
    with _on_first_rank(comm, targets[0]) as hidden:
        with together(comm):
            if comm.rank == 0:
                _require_room(targets, size)
        error: Exception | None = None
        try:
            write(hidden)
        except (OSError, RuntimeError) as caught:  # HDF5 and ADIOS2 report a full disk in their own ways
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
