"""Files that are read: they must be there."""

from __future__ import annotations

from pathlib import Path

from fenics_contact.errors import InvalidInputError


def require_file(path: Path, what: str = "a file") -> None:
    """Refuse a path that leads to no file; a name that is too long, or lies in a closed folder, too.

    Args:
        path: The path.
        what: What is expected there, with its article.

    Raises:
        InvalidInputError: Saying what is there instead.
    """
    try:
        if path.is_file():
            return
        instead = "a folder" if path.is_dir() else "something else" if path.exists() else "none"
        reason = f"there is {instead}"
    except OSError as error:
        reason = f"it cannot be looked at: {error.strerror or error}"
    raise InvalidInputError(f"there must be {what} '{path}', {reason}: check the name and folder")
