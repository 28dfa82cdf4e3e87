"""Names of files made from names of bodies."""

from __future__ import annotations

import hashlib
import os
import re
from collections.abc import Iterable
from pathlib import Path

from fenics_contact.errors import InvalidInputError

#: Bytes of a file's name before its suffix: most disks take 255, also for the hidden ones of files in work.
LONGEST = 200


def file_of_each(bodies: Iterable[str], folder: Path, stem: str, suffix: str) -> dict[str, Path]:
    """Name one file for each body: "state_link_1.vtu" for the body "link 1".

    Args:
        bodies: Names of the bodies, any text.
        folder: Folder of the files.
        stem: Beginning of their names.
        suffix: Suffix with the dot.

    Returns:
        Body name -> file. Names that differ only in special characters are numbered, those that no disk takes
        are cut and end in a number made from the whole name.
    """
    files: dict[str, Path] = {}
    for body in bodies:
        plain = f"{stem}_{re.sub(r'[^A-Za-z0-9.-]+', '_', body)}"
        if len(os.fsencode(plain)) > LONGEST:
            plain = f"{plain[: LONGEST - 9]}_{hashlib.sha256(f'{stem}_{body}'.encode()).hexdigest()[:8]}"
        path, number = folder / f"{plain}{suffix}", 1
        while path in files.values():
            number += 1
            path = folder / f"{plain}_{number}{suffix}"
        files[body] = path
    return files


def checked_name(folder: str | Path, name: str, suffix: str) -> Path:
    """Return the path of a file name in a folder.

    Raises:
        InvalidInputError: If the name is empty, contains a folder or is too long.
    """
    if not name.strip(".") or Path(name).name != name:
        raise InvalidInputError(
            f"name must be the beginning of a file's name, got {name!r}: put folders into folder"
        )
    if len(os.fsencode(name)) > LONGEST:
        raise InvalidInputError(
            f"name must have at most {LONGEST} bytes, as disks take no longer ones with what is added to it, "
            f"got {len(os.fsencode(name))}: give a shorter one"
        )
    return Path(folder) / f"{name}{suffix}"
