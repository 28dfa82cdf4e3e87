"""One file, replaced at once: a reader finds the old or the new one, whatever happens to the writer."""

from __future__ import annotations

import glob
import os
import secrets
from contextlib import suppress
from pathlib import Path

from fenics_contact.errors import FenicsContactError


class CheckpointError(FenicsContactError, OSError):
    """A checkpoint could not be written; the one before, if there was one, is as it was."""


def write_whole(path: Path, content: bytes) -> None:
    """Write a checkpoint as `put_whole` does.

    Args:
        path: The file; its folder is created.
        content: All of it.

    Raises:
        CheckpointError: If the disk is full or the folder cannot be written to; the target is then what it
            was.
    """
    try:
        put_whole(path, content)
    except OSError as error:
        before = "the one before is as it was" if path.exists() else "there is none yet"
        raise CheckpointError(
            f"a checkpoint needs {len(content)} bytes in {str(path.parent)!r}, but {path.name!r} could not "
            f"be written: {error.strerror or error} ({before}). Free space, make the folder writable and let "
            "only one run write to this name; run again, and it goes on from the last whole checkpoint"
        ) from error


def put_whole(path: Path, content: bytes) -> None:
    """Put a file in place of another, on the disk before it gets its name.

    The content goes to ``.NAME.XXXXXXXX.partial`` beside the target. What writers that were killed have left
    under such names is removed; a writer that loses its file that way says so.

    Args:
        path: The file; its folder is created.
        content: All of it.

    Raises:
        OSError: If the disk is full or the folder cannot be written to; the target is then what it was.
    """
    partial = path.with_name(f".{path.name}.{secrets.token_hex(4)}.partial")
    path.parent.mkdir(parents=True, exist_ok=True)
    for left in path.parent.glob(f".{glob.escape(path.name)}.*.partial"):
        left.unlink(missing_ok=True)
    try:
        _write(partial, content)
        os.replace(partial, path)
    except OSError:
        with suppress(OSError):
            partial.unlink(missing_ok=True)
        raise
    synchronise(path.parent)


def _write(path: Path, content: bytes) -> None:
    """Write and wait until the file is on the disk."""
    with path.open("wb") as file:
        file.write(content)
        file.flush()
        os.fsync(file.fileno())


def synchronise(path: Path) -> None:
    """Wait until a file or folder is on the disk."""
    descriptor = os.open(path, os.O_RDONLY)
    try:
        os.fsync(descriptor)
    finally:
        os.close(descriptor)
