"""PVD files: the files of a series by time, for ParaView."""

from __future__ import annotations

import math
import xml.etree.ElementTree as ET
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path
from xml.sax.saxutils import quoteattr

from fenics_contact.errors import InvalidInputError


@dataclass(frozen=True, order=True)
class Member:
    """One state of a series.

    Attributes:
        label: Description; ParaView stores it as the field datum "Name".
    """

    value: float
    number: int
    label: str = ""


def stem_of(name: str, number: int) -> str:
    """Return the stem of a member's file names."""
    return f"{name}_{number:04d}"


def collection(name: str, members: Sequence[Member]) -> str:
    """Return the text of a PVD file with the multi-block file of every member."""
    lines = "".join(
        f'    <DataSet timestep="{member.value!r}" group="" part="0" '
        f"file={quoteattr(f'{name}/{stem_of(name, member.number)}.vtm')}"
        f"{f' name={quoteattr(member.label)}' if member.label else ''}/>\n"
        for member in sorted(members)
    )
    return (
        '<?xml version="1.0"?>\n<VTKFile type="Collection" version="0.1">\n'
        f"  <Collection>\n{lines}  </Collection>\n</VTKFile>\n"
    )


def read_collection(path: Path) -> list[Member]:
    """Return the members of a PVD file whose multi-block files exist.

    Raises:
        InvalidInputError: If it cannot be read or was not written by a `ResultSeries`.
    """
    name, members = path.stem, []
    try:
        for entry in ET.parse(path).getroot().iter("DataSet"):
            file = entry.attrib["file"]
            member = Member(
                float(entry.attrib["timestep"]),
                int(Path(file).stem.removeprefix(f"{name}_")),
                entry.attrib.get("name", ""),
            )
            if file != f"{name}/{stem_of(name, member.number)}.vtm" or not math.isfinite(member.value):
                raise ValueError(f"it names {file!r} at {member.value}")
            if (path.parent / file).is_file():
                members.append(member)
    except (OSError, ET.ParseError, KeyError, ValueError) as error:
        raise InvalidInputError(
            f"a series needs a PVD file that a ResultSeries wrote, or none, {str(path)!r} is another one "
            f"({error}): give the series another name, or move the file away"
        ) from error
    return sorted(members)
