"""Reading of result files, with errors that state what is wrong with them."""

from __future__ import annotations

import json
from pathlib import Path
from typing import Any

from fenics_contact.errors import InvalidInputError

#: Value of ``format`` in files of `write_result`.
FORMAT = "fenics_contact result"
FORMAT_VERSION = 1


def read_result(path: str | Path) -> dict[str, Any]:
    """Read a file of `write_result` or `write_optimisation_result`.

    Args:
        path: The file, or a folder that holds a "result.json".

    Returns:
        The entries as described there.

    Raises:
        InvalidInputError: If there is no such file, it cannot be read, is not complete JSON, not a result, or
            of a newer format; states what to do.

    Example:
        >>> read_result("output/result.json")["energies"]["total_potential"]  # doctest: +SKIP
    """
    file = Path(path)
    file = file / "result.json" if file.is_dir() else file
    try:
        data = json.loads(file.read_text(encoding="utf-8"))
    except OSError as error:
        raise InvalidInputError(
            f"a result is needed at {str(file)!r}, which cannot be read: {error.strerror or error}; give the "
            "file that write_result returned, or its folder"
        ) from error
    except ValueError as error:  # of JSON or of the encoding
        raise InvalidInputError(
            f"a result must be a whole JSON file, {str(file)!r} is none ({error}): it was cut or edited; "
            "bring back a copy or write it again"
        ) from error
    if not isinstance(data, dict) or data.get("format") != FORMAT:
        kind = data.get("format") if isinstance(data, dict) else None
        raise InvalidInputError(
            f'a result must say "format": {FORMAT!r}, {str(file)!r} says {kind!r}: give a file that '
            "write_result or write_optimisation_result wrote"
        )
    version = data.get("format_version")
    if not isinstance(version, int) or version < 1:
        raise InvalidInputError(
            f"a result must have a format_version of 1 or more, {str(file)!r} has {version!r}: write it again"
        )
    if version > FORMAT_VERSION:
        raise InvalidInputError(
            f"this version of fenics_contact reads results up to format_version {FORMAT_VERSION}, "
            f"{str(file)!r} has {version}: read it with a newer version"
        )
    return data
