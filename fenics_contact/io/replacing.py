"""Files appear whole: they are written under another name in the same folder and then renamed."""

from __future__ import annotations

import os
import secrets
import shutil
from collections.abc import Iterator, Sequence
from contextlib import contextmanager
from pathlib import Path

from fenics_contact.checkpoint.whole_file import synchronise


@contextmanager
def replacing(*targets: Path) -> Iterator[tuple[Path, ...]]:
    """Hand out paths to write to, and put what was written in the targets' place at the end.

    If the block raises, the targets stay as they were. Each file is replaced at once; several are replaced
    one after the other in the order given, so one that names others belongs last.

    Args:
        *targets: Files to write, all in one folder, which is created.

    Yields:
        For every target a path of the same name in a hidden folder beside it.
    """
    folder = targets[0].parent
    folder.mkdir(parents=True, exist_ok=True)
    hidden = folder / f".{targets[0].stem}.{secrets.token_hex(4)}"
    hidden.mkdir()
    try:
        yield tuple(hidden / target.name for target in targets)
        replace_all([hidden / target.name for target in targets], folder)
    finally:
        shutil.rmtree(hidden, ignore_errors=True)


def replace_all(written: Sequence[Path], folder: Path) -> None:
    """Move complete files into a folder, one after the other, so that each survives a loss of power."""
    for path in written:
        synchronise(path)
    for path in written:
        os.replace(path, folder / path.name)
    synchronise(folder)
