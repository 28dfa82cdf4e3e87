"""Names of files made from names of bodies."""

from __future__ import annotations

import re
from collections.abc import Iterable
from pathlib import Path

from fenics_contact.errors import InvalidInputError


def file_of_each(bodies: Iterable[str], folder: Path, stem: str, suffix: str) -> dict[str, Path]:
    """Name one file for each body: "state_link_1.vtu" for the body "link 1".

    Args:
        bodies: Names of the bodies, any text.
        folder: Folder of the files.
        stem: Beginning of their names.
        suffix: Suffix with the dot.

    Returns:
        Body name -> file. Names that differ only in special characters are numbered.
    """
    files: dict[str, Path] = {}
    for body in bodies:
        plain = f"{stem}_{re.sub(r'[^A-Za-z0-9.-]+', '_', body)}"
        path, number = folder / f"{plain}{suffix}", 1
        while path in files.values():
            number += 1
            path = folder / f"{plain}_{number}{suffix}"
        files[body] = path
    return files


def checked_name(folder: str | Path, name: str, suffix: str) -> Path:
    """Return the path of a file name in a folder.

    Raises:
        InvalidInputError: If the name is empty or contains a folder.
    """
    if not name.strip(".") or Path(name).name != name:
        raise InvalidInputError(
            f"name must be the beginning of a file's name, got {name!r}: put folders into folder"
        )
    return Path(folder) / f"{name}{suffix}"
