"""What a page is made of: the fields of one or several states, and the record of the result."""

from __future__ import annotations

import json
from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Any

from fenics_contact.contact import State
from fenics_contact.errors import InvalidInputError
from fenics_contact.io import (
    FIELD_FILES,
    fields_of_result,
    json_text,
    read_result,
    result_record,
    stored_fields,
)
from fenics_contact.viz import Units

if TYPE_CHECKING:
    import pyvista
    from mpi4py import MPI


@dataclass(frozen=True)
class Source:
    """The content of a page.

    Attributes:
        comm: Ranks that know it, None if only the calling one does.
    """

    steps: list[tuple[str, Mapping[str, pyvista.UnstructuredGrid]]]
    record: Mapping[str, Any]
    name: str = "Result"
    comm: MPI.Comm | None = None

    @property
    def title(self) -> str:
        """The title that the result's scene file gives, the source's name if there is none."""
        return str((self.record.get("more") or {}).get("title") or self.name)

    @property
    def units(self) -> Units:
        """The names of units that the result's scene file gives, mm, N and MPa if there are none."""
        return Units(**((self.record.get("more") or {}).get("unit_names") or {}))


def source_of_states(states: Mapping[str, State]) -> Source:
    """Return the fields of states by name and the record of the last one. Collective."""
    strange = [type(state).__name__ for state in states.values() if not isinstance(state, State)]
    if strange or not states:
        raise InvalidInputError(
            f"a page needs a state, states by name, or a file, got {', '.join(strange) or 'none'}: give what "
            "solve_scene returned, or the folder that write_result wrote to"
        )
    steps: list[tuple[str, Mapping[str, pyvista.UnstructuredGrid]]] = []
    for name, state in states.items():
        blocks = state.to_pyvista()
        steps.append((name, {body: blocks[body] for body in blocks.keys()}))
    last = list(states.values())[-1]
    return Source(steps, json.loads(json_text(result_record(last))), comm=last.torn.decomposition.comm)


def source_of_files(path: Path) -> Source:
    """Return the fields of a folder of results, of its result.json or of a file of fields, and the record.

    Raises:
        InvalidInputError: If there is no result, or one without fields.
    """
    folder = path if path.is_dir() else path.parent
    if path.suffix in FIELD_FILES:
        fields: Path | None = path
        record = read_result(folder) if (folder / "result.json").is_file() else {}
    else:
        record, fields = read_result(path), fields_of_result(folder)
    if fields is None:
        raise InvalidInputError(
            f"a page needs the fields of a result, {str(folder)!r} has no .vtm or .pvd file: write them with "
            'write_vtu, in a scene file with [output] files = ["vtu"]'
        )
    members = stored_fields(fields)
    return Source(
        [(member.label or f"{member.value:g}", member.read()) for member in members],
        record,
        folder.resolve().name,
    )
