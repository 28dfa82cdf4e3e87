"""One run at a time in a folder: a second one would mistake the files of the first for its own.

A run holds a lock on a hidden file in its folder. The system releases the lock of a run that dies for any
reason; the remaining file blocks no other run.
"""

from __future__ import annotations

import fcntl
import logging
import os
import socket
from collections.abc import Iterator
from contextlib import contextmanager, suppress
from datetime import datetime
from pathlib import Path
from typing import TYPE_CHECKING

from fenics_contact.errors import InvalidInputError, together
from fenics_contact.io.replacing import OutputError

if TYPE_CHECKING:
    from mpi4py import MPI

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
                    f"results must be written to the folder {str(folder)!r}, which cannot be done: {reason}. "
                    "Make it writable or give another one"
                ) from error
    try:
        yield
    finally:
        if lock is not None:
            path.unlink(missing_ok=True)
            os.close(lock)
        if made:
            with suppress(OSError):  # not empty: something was written
                path.parent.rmdir()


def _taken(path: Path) -> int | None:
    """Lock a file, created if necessary; None where there are no locks."""
    while True:
        lock = os.open(path, os.O_RDWR | os.O_CREAT, 0o666)
        try:
            fcntl.flock(lock, fcntl.LOCK_EX | fcntl.LOCK_NB)
        except BlockingIOError:
            owner = os.pread(lock, 200, 0).decode("utf-8", "replace").strip()
            os.close(lock)
            raise InvalidInputError(
                f"a folder must have one run at a time, another one ({owner or 'just begun'}) writes to "
                f"{str(path.parent)!r}: wait for its end, or give this run another folder"
            ) from None
        except OSError as error:
            os.close(lock)
            path.unlink(missing_ok=True)
            _LOG.warning(
                "%s: no locks there (%s), let no other run write to this folder", path.parent, error.strerror
            )
            return None
        if _is_still(path, lock):
            os.ftruncate(lock, 0)
            begun = datetime.now().astimezone().isoformat(" ", "seconds")
            os.pwrite(lock, f"process {os.getpid()} on {socket.gethostname()}, begun {begun}".encode(), 0)
            return lock
        os.close(lock)  # its owner has removed it since it was opened


def _is_still(path: Path, descriptor: int) -> bool:
    """Return whether an open file is the one at a path."""
    try:
        return os.path.samestat(os.fstat(descriptor), path.stat())
    except FileNotFoundError:
        return False
