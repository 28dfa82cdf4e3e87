"""Files appear whole: they are written under another name in the same folder and then renamed.

The other name is that of a hidden folder, ``.NAME.XXXXXXXX.partial``, whose writer holds a lock on it. The
system takes the lock away from a writer that dies, however it dies; the next writer that comes to the folder
removes what such writers have left.
"""

from __future__ import annotations

import errno
import fcntl
import os
import re
import secrets
import shutil
import time
from collections.abc import Callable, Iterator, Sequence
from contextlib import contextmanager, suppress
from pathlib import Path
from typing import TYPE_CHECKING

from fenics_contact.checkpoint.whole_file import synchronise
from fenics_contact.errors import FenicsContactError, agree, together

if TYPE_CHECKING:
    from mpi4py import MPI

_HIDDEN = re.compile(r"\..+\.[0-9a-f]{8}\.partial")
#: Where the file system knows no locks, age tells: no writer takes that long for a file, [s].
_ABANDONED = 24 * 3600.0


class OutputError(FenicsContactError, OSError):
    """A file could not be written; what was there under its name is as it was."""


@contextmanager
def replacing(*targets: Path) -> Iterator[tuple[Path, ...]]:
    """Hand out paths to write to, and put what was written in the targets' place at the end.

    If the block raises, the targets stay as they were. Each file is replaced at once. Of several the last
    must be one that names the others: it is there only while all the others are.

    Args:
        *targets: Files (or folders) to write, all in one folder, which is created.

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
    """Write a text file whole or not at all; raises as `replacing` does."""
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
    """Let all ranks write the same files, and put them in their place when all are done. Collective.

    Args:
        comm: Communicator.
        targets: Files to write, all in one folder, which is created; in the order in which they are replaced.
        write: Takes the hidden folder and writes files of the targets' names into it. Collective.
        size: About how many bytes that takes: less room is refused beforehand, as the libraries that write in
            parallel end the whole run when they meet a full disk.
        repair: Takes the hidden folder on rank 0 before the files are moved.

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
        except (OSError, RuntimeError) as caught:  # HDF5 and ADIOS2 tell of a full disk in their own ways
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
    """Make a hidden folder on rank 0 and tell all ranks its name. Collective."""
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


@contextmanager
def hidden_folder(folder: Path, stem: str) -> Iterator[Path]:
    """Make a hidden folder to write in, and remove it in the end; remove those of dead writers before.

    Args:
        folder: Where to make it; created.
        stem: What its name begins with.
    """
    folder.mkdir(parents=True, exist_ok=True)
    remove_abandoned(folder)
    hidden, lock = _made(folder, stem)
    try:
        yield hidden
    finally:
        shutil.rmtree(hidden, ignore_errors=True)
        if lock is not None:
            os.close(lock)


def remove_abandoned(folder: Path) -> None:
    """Remove the hidden folders of writers that are dead."""
    for left in folder.glob(".*.partial"):
        if not _HIDDEN.fullmatch(left.name) or not left.is_dir():
            continue
        with suppress(OSError):  # another writer may remove it at the same time
            taken, lock = _locked(left)
            if taken or (lock is None and time.time() - left.stat().st_mtime > _ABANDONED):
                shutil.rmtree(left, ignore_errors=True)
            if lock is not None:
                os.close(lock)


def replace_all(written: Sequence[Path], folder: Path) -> None:
    """Move complete files or folders into a folder, one after the other; each survives a loss of power.

    The last of several names the others. The old one goes first, so that none ever names files of which some
    are older than others.
    """
    for path in written:
        for part in (*path.rglob("*"), path) if path.is_dir() else (path,):
            synchronise(part)
        if path.is_file() and (folder / path.name).is_dir():
            raise IsADirectoryError(errno.EISDIR, os.strerror(errno.EISDIR), path.name)
    if len(written) > 1:
        (folder / written[-1].name).unlink(missing_ok=True)
    for path in written:
        target = folder / path.name
        if path.is_dir() and target.is_dir():  # unlike a file, it cannot be replaced at once
            shutil.rmtree(target)
        os.replace(path, target)
    synchronise(folder)


def _made(folder: Path, stem: str) -> tuple[Path, int | None]:
    """Make a hidden folder and lock it, where the file system can."""
    while True:
        hidden = folder / f".{stem}.{secrets.token_hex(4)}.partial"
        hidden.mkdir()
        with suppress(FileNotFoundError):
            taken, lock = _locked(hidden)
            # Between its making and its lock another writer may have taken it for an abandoned one.
            if (taken or lock is None) and hidden.exists():
                return hidden, lock
            if lock is not None:
                os.close(lock)


def _locked(path: Path) -> tuple[bool, int | None]:
    """Try to lock a folder: whether it worked, and the open folder, None where there are no locks."""
    descriptor = os.open(path, os.O_RDONLY)
    try:
        fcntl.flock(descriptor, fcntl.LOCK_EX | fcntl.LOCK_NB)
    except BlockingIOError:
        return False, descriptor
    except OSError:
        os.close(descriptor)
        return False, None
    return True, descriptor


def _output_error(targets: Sequence[Path], error: Exception) -> OutputError:
    """Return the error that says which files could not be written, why, and what to do."""
    reason = (error.strerror if isinstance(error, OSError) else None) or str(error) or type(error).__name__
    names = ", ".join(repr(target.name) for target in targets[:3])
    more = f" and {len(targets) - 3} more" if len(targets) > 3 else ""
    return OutputError(
        f"{names}{more} could not be written to the folder {str(targets[0].parent)!r}: {reason}. What was "
        "there under these names is as it was: free space, make the folder writable or give another one"
    )
