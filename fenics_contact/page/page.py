"""A web page of a result, one file that needs no other and no network."""

from __future__ import annotations

import json
from collections.abc import Mapping
from contextlib import nullcontext
from html import escape
from importlib import resources
from pathlib import Path
from typing import Any

import numpy as np

from fenics_contact._requirements import require_extra
from fenics_contact.contact import State
from fenics_contact.errors import InvalidInputError, together
from fenics_contact.io import write_text
from fenics_contact.page.bodies import body_entry, is_plane
from fenics_contact.page.colours import colour_scales
from fenics_contact.page.fields import field_entries
from fenics_contact.page.obstacles import obstacle_entries
from fenics_contact.page.packing import Arrays
from fenics_contact.page.source import Source, source_of_files, source_of_states
from fenics_contact.page.tables import sections, status_words
from fenics_contact.viz import InteractiveScene, Units


def result_page(
    result: State | Mapping[str, State] | str | Path,
    path: str | Path | None = None,
    *,
    title: str = "",
    units: Units | None = None,
) -> InteractiveScene:
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
        title: Title of the page; that of the result unless given.
        units: Names of the units; those of the result unless given.

    Returns:
        The page, which Jupyter shows as the value of a cell.

    Raises:
        InvalidInputError: If there is no such result, or it has no fields.
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
            page = _filled(source, title or source.title, units or source.units)
            if target is not None:
                write_text(target, page)
    return InteractiveScene(page, target, height=900)


def _filled(source: Source, title: str, units: Units) -> str:
    """Return the text of the page: the template with everything in its place."""
    from plotly.offline import get_plotlyjs

    arrays = Arrays()
    data = _data(source, title, units, arrays)
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
    return resources.files("fenics_contact.page").joinpath(name).read_text(encoding="utf-8")


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
        "scale": 1.0 if obstacles else _visible_scale(everything, points),
        "obstacles": obstacles,
        "status": status_words((source.record.get("scene") or {}).get("contacts") or ()),
        "colours": colour_scales(),
        "history": _history(source.record),
    }
    return {**data, "arrays": arrays.index}


def _visible_scale(grids: list[Any], points: np.ndarray, visible: float = 0.03) -> float:
    """Return the factor, 1, 2 or 5 times a power of ten, by which displacement becomes visible."""
    moved = [grid.point_data["displacement"] for grid in grids if "displacement" in grid.point_data]
    largest = max((float(np.linalg.norm(part, axis=1).max()) for part in moved), default=0.0)
    if not largest > 0:
        return 1.0
    factor = max(1.0, visible * float(np.ptp(points, axis=0).max()) / largest)
    power = 10.0 ** np.floor(np.log10(factor))
    return float(power * max(step for step in (1.0, 2.0, 5.0) if step * power <= factor * (1 + 1e-9)))


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
