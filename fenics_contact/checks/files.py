"""Checks that input files exist."""

from __future__ import annotations

from pathlib import Path

from fenics_contact.errors import InvalidInputError


def require_file(path: Path, what: str = "a file") -> None:
    """Reject a path that is not a readable file, also if its name is too long or its folder closed.

    Args:
        path: The path.
        what: Description of the expected file, with its article.

    Raises:
        InvalidInputError: States what is there instead.
    """
    try:
        if path.is_file():
            return
        instead = "a folder" if path.is_dir() else "something else" if path.exists() else "none"
        reason = f"there is {instead}"
    except OSError as error:
        reason = f"it cannot be looked at: {error.strerror or error}"
    raise InvalidInputError(f"there must be {what} '{path}', {reason}: check the name and folder")
