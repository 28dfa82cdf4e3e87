"""A web page of a result, one file that needs no other and no network."""

from __future__ import annotations

import json
from collections.abc import Mapping
from contextlib import nullcontext
from dataclasses import dataclass
from dataclasses import field as attribute
from html import escape
from importlib import resources
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from fenics_contact._base.requirements import require_extra
from fenics_contact._page.content import (
    Arrays,
    body_entry,
    colour_scales,
    obstacle_entries,
    sections,
    status_words,
)
from fenics_contact.errors import InvalidInputError, together
from fenics_contact.output.files import json_text, write_text
from fenics_contact.output.reading import FIELD_FILES, fields_of_result, read_result, stored_fields
from fenics_contact.output.result import result_record
from fenics_contact.pictures.canvas import Units
from fenics_contact.pictures.section import field_entries, is_plane
from fenics_contact.pictures.states import chosen_scale
from fenics_contact.results.state import State

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
    """Return the fields of a folder of results, of its result.json or of a file of fields, and the record."""
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


#: The page is a frame of its own, so that its styles do not affect the notebook's.
_FRAME = '<iframe srcdoc="{page}" style="width: 100%; height: 900px; border: 1px solid #dddddd"></iframe>'


@dataclass(frozen=True, eq=False)
class Page:
    """A web page that Jupyter shows as the value of a cell; it shows nothing on ranks that did not make it.

    Attributes:
        html: The page on the rank that made it, None on the others.
        path: The file it was written to, None if it was not.
    """

    html: str | None = attribute(repr=False)
    path: Path | None = None

    def __fspath__(self) -> str:
        """Return the path of the file."""
        if self.path is None:
            raise InvalidInputError(
                "this needs the file of a page, but the page was not written: give result_page a path, such "
                "as 'page.html'"
            )
        return str(self.path)

    def __str__(self) -> str:
        """Return the path of the file, or a text if there is none."""
        return "page without a file" if self.path is None else str(self.path)

    def _repr_mimebundle_(self, **_: Any) -> dict[str, str]:
        if self.html is None:
            return {"text/plain": ""}
        return {"text/html": _FRAME.format(page=escape(self.html)), "text/plain": str(self)}


def result_page(
    result: State | Mapping[str, State] | str | Path,
    path: str | Path | None = None,
    *,
    field: str = "",
    title: str = "",
    units: Units | None = None,
) -> Page:
    """Make a web page of a result: bodies to turn, to cut and to colour, curves and tables. Collective.

    The page is one file that works without a server and without a network, and in notebooks. It shows the
    bodies with any of their fields, a section, a magnified deformation, the contact, the load steps, the
    history of residuals, forces and moments, and how it was computed. It holds the meshes and all fields of
    all steps, numbers with four digits: for each step a megabyte for 15 000 cells, besides 5 MB for the
    library plotly, which draws.

    Args:
        result: A state; several by name, which become load steps, as do those of a series; or files: a folder
            of results, its result.json, or a .vtu, .vtm or .pvd file. Of files the page is made by the
            calling rank alone, and not collectively.
        path: HTML file to write, None to write none. A file of that name is replaced when the new one is
            complete.
        field: Name of the field that is shown first, such as "contact_pressure"; the others are in its menu.
        title: Title of the page; that of the result unless given.
        units: Names of the units; those of the result unless given.

    Returns:
        The page, which Jupyter shows as the value of a cell.

    Raises:
        InvalidInputError: If there is no such result, or it has no fields, or not the one to show first.
        MissingRequirementError: If plotly or pyvista is missing.
        OutputError: If the file cannot be written.

    Example:
        >>> result_page("output/chain_links", "chain_links.html")  # doctest: +SKIP
        >>> result_page(state)  # in a notebook  # doctest: +SKIP
    """
    require_extra("web pages", "viz", "plotly", "pyvista")
    target = None if path is None else Path(path)
    if target is not None and target.suffix != ".html":
        raise InvalidInputError(f"pages are HTML files, got the name {target.name!r}: let it end in '.html'")
    if isinstance(result, State):
        result = {"": result}
    source = source_of_states(result) if isinstance(result, Mapping) else source_of_files(Path(result))
    page = None
    with nullcontext() if source.comm is None else together(source.comm):
        if source.comm is None or source.comm.rank == 0:
            page = _filled(source, title or source.title, units or source.units, field)
            if target is not None:
                write_text(target, page)
    return Page(page, target)


def _filled(source: Source, title: str, units: Units, field: str) -> str:
    """Return the text of the page: the template with everything in its place."""
    from plotly.offline import get_plotlyjs

    arrays = Arrays()
    data = _data(source, title, units, arrays)
    data["first"] = _first(data["fields"], field)
    parts = {
        "title": escape(title),
        "style": _file("page.css"),
        "tables": sections(source.record, units),
        "data": json.dumps(data, ensure_ascii=False).replace("<", "\\u003c"),
        "arrays": arrays.packed(),
        "library": get_plotlyjs(),
        "script": "".join(map(_file, ("geometry.js", "content.js", "view.js", "curves.js", "controls.js"))),
    }
    whole = [_file("page.html")]
    for name, text in parts.items():  # a text may contain what marks the place of another
        before, after = whole.pop().split(f"<!--{name}-->")
        whole += [before, text, after]
    return "".join(whole)


def _file(name: str) -> str:
    return resources.files("fenics_contact._page").joinpath(name).read_text(encoding="utf-8")


def _data(source: Source, title: str, units: Units, arrays: Arrays) -> dict[str, Any]:
    """Return what the page's script reads, with the numbers of arrays in place of these."""
    bodies = list(dict.fromkeys(name for _, grids in source.steps for name in grids))
    everything = [grid for _, grids in source.steps for grid in grids.values()]
    if not everything:
        raise InvalidInputError("a page needs at least one body, the files have none: write the result again")
    points = np.concatenate([np.asarray(grid.points) for grid in everything])
    obstacles = obstacle_entries(source.record, points)
    data = {
        "title": title,
        "plane": all(map(is_plane, everything)),
        "length": units.length,
        "bodies": bodies,
        "fields": field_entries([grids for _, grids in source.steps], units),
        "steps": [
            {
                "label": label,
                "bodies": [
                    body_entry(name, grids[name], arrays) if name in grids else None for name in bodies
                ],
            }
            for label, grids in source.steps
        ],
        "scale": 1.0 if obstacles else max(chosen_scale(grids) for _, grids in source.steps),
        "obstacles": obstacles,
        "status": status_words((source.record.get("scene") or {}).get("contacts") or ()),
        "colours": colour_scales(),
        "history": _history(source.record),
    }
    return {**data, "arrays": arrays.index}


def _first(fields: list[dict[str, Any]], name: str) -> int:
    """Return the number of the field that is shown first."""
    names = [entry["source"] for entry in fields]
    if name and name not in names:
        raise InvalidInputError(
            f"field must be one of {', '.join(dict.fromkeys(names))}, got {name!r}: choose one of them"
        )
    return names.index(name) if name else 0


def _history(record: Mapping[str, Any]) -> dict[str, Any]:
    """Return the curves of the page: residuals, and the objective of an optimisation."""
    evaluations = (record.get("optimisation") or {}).get("history") or {}
    return {
        "residuals": record.get("residual_history") or {},
        "tolerance": (record.get("solver") or {}).get("tolerance"),
        "evaluations": {
            name: evaluations[name] for name in ("evaluations", "value", "best") if name in evaluations
        },
    }
