"""Atomic files: a reader sees the old or the new one, whatever happens to the writer.

They are written under another name in the same folder and then renamed. The other name is that of a hidden
folder, ``.NAME.XXXXXXXX.partial``, whose writer holds a lock on it. The system releases the lock of a writer
that dies for any reason; the next one in the folder removes the remains of such writers.
"""

from __future__ import annotations

import errno
import fcntl
import os
import re
import secrets
import shutil
import time
from collections.abc import Iterator, Sequence
from contextlib import contextmanager, suppress
from dataclasses import dataclass
from pathlib import Path

from fenics_contact.errors import FenicsContactError

_HIDDEN = re.compile(r"\..+\.[0-9a-f]{8}\.partial")


class CheckpointError(FenicsContactError, OSError):
    """A checkpoint could not be written; an earlier one is unchanged."""


def write_whole(path: Path, content: bytes) -> None:
    """Write a checkpoint by `write_atomically`."""
    try:
        write_atomically(path, content)
    except OSError as error:
        before = "the one before is as it was" if path.exists() else "there is none yet"
        raise CheckpointError(
            f"{len(content)} bytes of {path.name!r} in {str(path.parent)!r} could not be written: "
            f"{error.strerror or error} ({before}): free space, let one run write, and run again to go on"
        ) from error


def write_atomically(path: Path, content: bytes) -> None:
    """Replace a file by another, which is on the disk before it is renamed."""
    with hidden_folder(path.parent, path.name) as hidden:
        partial, before = hidden / path.name, _version(path)
        partial.write_bytes(content)
        synchronise(partial)
        if _version(path) != before:
            raise FileExistsError(errno.EEXIST, "another run has written it meanwhile")
        os.replace(partial, path)
    synchronise(path.parent)


def _version(path: Path) -> tuple[int, int] | None:
    """Return the identity of a file, by which a replacement is detected, None if there is none."""
    with suppress(FileNotFoundError):
        status = path.stat()
        return status.st_ino, status.st_mtime_ns
    return None


@contextmanager
def hidden_folder(folder: Path, stem: str) -> Iterator[Path]:
    """Create a hidden folder to write in, and remove it at the end; first remove those of dead writers."""
    folder.mkdir(parents=True, exist_ok=True)
    remove_abandoned(folder)
    hidden, lock = _made(folder, stem)
    try:
        yield hidden
    finally:
        shutil.rmtree(hidden, ignore_errors=True)
        lock.close()


def remove_abandoned(folder: Path, abandoned: float = 24 * 3600.0) -> None:
    """Remove the hidden folders of dead writers.

    `abandoned`: on file systems without locks, age at which a folder counts as abandoned: no write takes that
    long.
    """
    for left in folder.glob(".*.partial"):
        if not _HIDDEN.fullmatch(left.name) or not left.is_dir():
            continue
        with suppress(OSError):  # another writer may remove it at the same time
            lock = locked(left)
            if lock.taken or (not lock.known and time.time() - left.stat().st_mtime > abandoned):
                shutil.rmtree(left, ignore_errors=True)
            lock.close()


def replace_all(written: Sequence[Path], folder: Path) -> None:
    """Move complete files into a folder, one after the other; each survives a loss of power.

    The last of several refers to the others. The old one is removed first, so that it never refers to files
    of different age.
    """
    for path in written:
        synchronise(path)
        if (folder / path.name).is_dir():
            raise IsADirectoryError(errno.EISDIR, os.strerror(errno.EISDIR), path.name)
    if len(written) > 1:
        (folder / written[-1].name).unlink(missing_ok=True)
    for path in written:
        os.replace(path, folder / path.name)
    synchronise(folder)


def _made(folder: Path, stem: str) -> tuple[Path, Lock]:
    """Create a hidden folder and lock it, if the file system supports locks."""
    while True:
        hidden = folder / f".{stem}.{secrets.token_hex(4)}.partial"
        hidden.mkdir()
        with suppress(FileNotFoundError):
            lock = locked(hidden)
            # Before it was locked another writer may have taken it for abandoned.
            if (lock.taken or not lock.known) and hidden.exists():
                return hidden, lock
            lock.close()


@dataclass(frozen=True)
class Lock:
    """A file or folder that is open to be locked.

    `taken`: by this process; `known`: whether the file system has locks.
    """

    descriptor: int
    taken: bool
    known: bool = True

    def close(self) -> None:
        """Release the lock."""
        os.close(self.descriptor)


def locked(path: Path) -> Lock:
    """Try to lock a file or folder."""
    descriptor = os.open(path, os.O_RDONLY)
    try:
        fcntl.flock(descriptor, fcntl.LOCK_EX | fcntl.LOCK_NB)
    except BlockingIOError:
        return Lock(descriptor, taken=False)
    except OSError:
        return Lock(descriptor, taken=False, known=False)
    return Lock(descriptor, taken=True)


def synchronise(path: Path) -> None:
    """Wait until a file or folder is on the disk."""
    descriptor = os.open(path, os.O_RDONLY)
    try:
        os.fsync(descriptor)
    finally:
        os.close(descriptor)
