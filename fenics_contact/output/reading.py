"""Reading of results: JSON files, and files of fields as pyvista's grids by body."""

from __future__ import annotations

import json
import xml.etree.ElementTree as ET
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Any

from fenics_contact._base.requirements import require_extra
from fenics_contact.errors import InvalidInputError

if TYPE_CHECKING:
    import pyvista


#: Suffixes of the files of fields that are read back.
FIELD_FILES = (".vtu", ".vtm", ".pvd")


@dataclass(frozen=True)
class StoredFields:
    """A file with the fields of one state.

    Attributes:
        value: Its time, load factor or number in a series, 0 where there is none.
        label: Its description in a series, such as the name of a load step.
    """

    file: Path
    value: float = 0.0
    label: str = ""

    def read(self) -> dict[str, pyvista.UnstructuredGrid]:
        """Return body name -> grid with all fields."""
        require_extra("files of fields", "viz", "pyvista")
        import pyvista

        if not self.file.is_file():
            raise InvalidInputError(
                f"a file of fields must exist, '{self.file}' does not: write the result again"
            )
        data = pyvista.read(self.file)
        if isinstance(data, pyvista.MultiBlock):
            return {str(name): data[name] for name in data.keys()}
        return {self.file.stem: data}


def fields_of_result(folder: Path) -> Path | None:
    """Return the file of fields to open in a folder of results: a series before a single state."""
    files = [*sorted(folder.glob("*.pvd")), *sorted(folder.glob("*.vtm"))]
    return files[0] if files else None


def stored_fields(path: str | Path) -> list[StoredFields]:
    """Return the members of a PVD file in the order of their values; any other file as the only one.

    Example:
        >>> [member.label for member in stored_fields("output/history.pvd")]  # doctest: +SKIP
        ['pressed', 'sheared']
    """
    path = Path(path)
    if path.suffix != ".pvd":
        return [StoredFields(path)]
    try:
        members = [
            StoredFields(
                path.parent / entry.attrib["file"],
                float(entry.get("timestep", 0)),
                entry.get("name", ""),
            )
            for entry in ET.parse(path).getroot().iter("DataSet")
        ]
    except (ET.ParseError, KeyError, OSError, ValueError) as error:
        raise InvalidInputError(f"'{path}' must be a whole .pvd file, got {error}: write it again") from error
    if not members:
        raise InvalidInputError(f"'{path}' must name at least one file of fields, it names none")
    return sorted(members, key=lambda member: member.value)


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
            f'a result must have "format": {FORMAT!r}, {str(file)!r} has {kind!r}: give a file that '
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
