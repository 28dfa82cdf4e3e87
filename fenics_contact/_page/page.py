"""A web page of a result, one file that needs no other and no network."""

from __future__ import annotations

import json
from collections.abc import Mapping, Sequence
from contextlib import nullcontext
from dataclasses import dataclass, replace
from dataclasses import field as attribute
from html import escape
from importlib import resources
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np
from matplotlib.colors import Colormap, to_hex

from fenics_contact._base.display import DerivedUnits, name_in_words
from fenics_contact._page.arrays import Arrays
from fenics_contact._page.obstacles import obstacle_entries
from fenics_contact.errors import InvalidInputError, together
from fenics_contact.mesh.faces import boundary_faces
from fenics_contact.output.files import json_text, write_text
from fenics_contact.output.paraview import FIELD_FILES, fields_of_result, stored_fields
from fenics_contact.output.result import listed_forces, read_result, result_record, scales_of
from fenics_contact.pictures.canvas import (
    BLUE,
    GREY,
    INK,
    LEVEL_MAP,
    ORANGE,
    PRESSURE_MAP,
    SIGNED_MAP,
    STRESS_MAP,
    Units,
)
from fenics_contact.pictures.section import (
    cells_of,
    field_entries,
    is_plane,
    linear,
    linear_cells,
    without_seams,
)
from fenics_contact.pictures.states import chosen_scale
from fenics_contact.results.multi_block import hanging_of
from fenics_contact.results.on_bodies import OnBodies
from fenics_contact.results.revolved import check_turned, turned_around

if TYPE_CHECKING:
    import pyvista
    from mpi4py import MPI


def body_entry(name: str, grid: pyvista.UnstructuredGrid, arrays: Arrays) -> dict[str, Any]:
    """Return the geometry and the fields of a body as numbers of arrays.

    Returns ``points``, (n, 3); ``triangles``, (t, 3) nodes of the skin, and the cell ``owner`` of each, (t,);
    ``edges`` and ``outline``, (e, 2) nodes of the lines of the mesh on the skin and of its sharp edges;
    ``cells``, (c, 3 | 4 | 8) corners; ``nodes`` and ``on_cells``, the fields by name. Quadratic cells are cut
    into linear ones.
    """
    cells, pieces, dim = linear_cells(name, grid)
    whole = cells, np.arange(len(cells))
    faces, owner = boundary_faces(cells, 3, hanging_of(grid)) if dim == 3 else whole
    quads = faces.shape[1] == 4
    triangles = np.concatenate([faces[:, [0, 1, 2]], faces[:, [0, 2, 3]]]) if quads else faces
    edges, outline = _lines(np.asarray(grid.points), faces)
    return {
        "points": arrays.add(np.asarray(grid.points), exact=True),
        "triangles": arrays.add(triangles),
        "owner": arrays.add(np.tile(owner, 2) if quads else owner),
        "edges": arrays.add(edges),
        "outline": arrays.add(outline),
        "cells": arrays.add(cells),
        "nodes": {key: arrays.add(np.asarray(values)) for key, values in grid.point_data.items()},
        "on_cells": {
            key: arrays.add(np.repeat(np.asarray(values), pieces, axis=0))
            for key, values in grid.cell_data.items()
        },
    }


def _lines(points: np.ndarray, faces: np.ndarray, sharp: float = 30.0) -> tuple[np.ndarray, np.ndarray]:
    """Return all edges of faces, and those at ends and where faces meet at a larger angle, (n, 2) each."""
    import pyvista as pv

    skin = pv.PolyData.from_regular_faces(points, faces)
    skin.point_data["node"] = np.arange(len(points))
    # Nodes of cells keep their numbers; lines are between nodes of their own.
    found = (skin.extract_all_edges(), skin.extract_feature_edges(feature_angle=sharp, manifold_edges=False))
    first, second = (
        np.asarray(lines.point_data["node"])[np.asarray(lines.lines).reshape(-1, 3)[:, 1:]]
        if lines.n_cells
        else np.zeros((0, 2), dtype=np.int64)
        for lines in found
    )
    return first, without_seams(points, second)


def colour_scales() -> dict[str, list[list[float | str]] | list[str] | str]:
    """Return places from 0 to 1 and their colours for sizes and signed values, and single colours by use."""
    return {
        "size": _samples(STRESS_MAP),
        "contact": _samples(PRESSURE_MAP),
        "signed": _samples(SIGNED_MAP),
        "level": _samples(LEVEL_MAP),
        "status": [GREY, BLUE, ORANGE],
        "line": INK,
        "obstacle": GREY,
    }


def _samples(colours: Colormap, count: int = 33) -> list[list[float | str]]:
    return [[float(place), to_hex(colours(float(place)))] for place in np.linspace(0.0, 1.0, count)]


Record = Mapping[str, Any]


def sections(record: Record, units: Units) -> str:
    """Return the tables of a result as HTML, each under its heading, of the entries in the record."""
    parts = {
        "Summary": _rows(_summary(record, units)),
        "Accuracy": _meshes(record),
        "Contact": _contact(record, units),
        "Heat": _rows(_heat(record, units)),
        "Load steps": _steps(record, units),
        "Rigid surfaces": _rows(_motions(record, units)),
        "Springs": _rows(_springs(record, units)),
        "Linear constraints": _rows(_constraints(record, units)),
        "Forces and moments": _forces(record, units),
        "Errors and residuals": _rows(_accuracy(record)),
        "Computed with": _rows(_origin(record)),
    }
    return "".join(f"<section><h2>{name}</h2>{part}</section>\n" for name, part in parts.items() if part)


def number(value: Any) -> str:
    """Return a value for readers: numbers with five digits, a dash for None."""
    if value is None:
        return "–"
    if isinstance(value, bool) or not isinstance(value, int | float):
        return str(value)
    text = f"{value:,}" if isinstance(value, int) else f"{value:.5g}"
    return text.replace(",", "\u202f").replace("-", "\u2212")


def _table(head: Sequence[str], rows: Sequence[Sequence[Any]], words: int) -> str:
    """Return a table of which the first columns are text; one of many columns is a list on narrow screens."""
    body = "".join(f"<tr>{_line('td', row, words, head or row)}</tr>\n" for row in rows)
    top = f"<thead><tr>{_line('th', head, words, head)}</tr></thead>" if head else ""
    kind = ' class="many"' if len(head) > 4 else ""
    return f'<div class="wide"><table{kind}>{top}<tbody>\n{body}</tbody></table></div>'


def _line(tag: str, cells: Sequence[Any], words: int, head: Sequence[Any]) -> str:
    texts = [escape(number(cell)) for cell in cells]
    names = [f' class="number" data-name="{escape(str(name))}"' for name in head]
    return "".join(
        f"<{tag}{'' if place < words else names[place]}>{text}</{tag}>" for place, text in enumerate(texts)
    )


def _rows(facts: Mapping[str, Any]) -> str:
    """Return a table of names and what they are."""
    kept = [(name, value) for name, value in facts.items() if value not in (None, "")]
    return _table((), kept, words=2) if kept else ""


def _summary(record: Record, units: Units) -> dict[str, Any]:
    scene, counts, solver = (record.get(name) or {} for name in ("scene", "counts", "solver"))
    energies, work = record.get("energies") or {}, _derived_units(record, units).moment
    facts: dict[str, Any] = {
        f"body {name}": f"{number(body['cells'])} cells ({body['cell_type']}), {number(body['nodes'])} nodes"
        for name, body in (scene.get("bodies") or {}).items()
    }
    facts |= {name.replace("f_", "F-").replace("_", " "): value for name, value in counts.items()}
    facts |= {
        f"energy, {name.replace('_', ' ')}": f"{number(value)} {work}"
        for name, value in energies.items()
        if value is not None
    }
    facts["solver"] = ", ".join([*solver.get("methods", ()), solver.get("reason") or ""]).strip(", ")
    facts["tolerance"] = _tolerance(solver.get("tolerance"))
    facts["held by nothing"] = "; ".join(record.get("unheld") or ())
    objective = (record.get("optimisation") or {}).get("objective") or {}
    return facts | {f"objective, {name.replace('_', ' ')}": value for name, value in objective.items()}


def _tolerance(given: Any) -> Any:
    """Return a tolerance; one that follows the mesh in words."""
    if not isinstance(given, Mapping) or "share" not in given:
        return given
    return f"solver's error at most {100 * given['share']:.3g} % of the discretisation's"


def _derived_units(record: Record, units: Units) -> DerivedUnits:
    return DerivedUnits.of(units.force, units.length, record.get("scene") or {})


def _accuracy(record: Record) -> dict[str, Any]:
    errors = record.get("errors") or {}
    facts = {f"residual, {name}": value for name, value in (record.get("residuals") or {}).items()}
    facts |= {
        f"error, {name.replace('_', ' ')}": "not estimated" if value is None else value
        for name, value in errors.items()
        if not isinstance(value, Mapping)
    }
    facts |= {f"error of {name}": value for name, value in (errors.get("by_body") or {}).items()}
    if facts and not errors:
        facts["errors"] = "not computed"
    return facts


def _contact(record: Record, units: Units) -> str:
    entries, derived = record.get("contact") or [], _derived_units(record, units)
    names = (record.get("scene") or {}).get("contacts") or [{}] * len(entries)
    rows: list[tuple[str, str]] = []
    for pair, entry in zip(names, entries, strict=True):
        rows.append(("contact", f"{_side(pair.get('slave'))} on {_side(pair.get('master'))}"))
        named = zip(("open", "stick", "slip"), status_words([pair]), strict=True)
        states = [f"{entry[name]} {word}" for name, word in named if word and name in entry]
        count = number(entry.get("points"))
        rows.append(("points", f"{count}: {', '.join(states)}" if states else count))
        rows += [
            (words, f"{number(entry[name])} {unit}")
            for name, words, unit in (
                ("normal_force", "sum of normal forces", derived.force),
                ("normal_resultant", "their resultant", derived.force),
                ("peak_pressure", "largest pressure", units.stress),
                ("peak_nominal_pressure", "largest nominal pressure", units.stress),
                ("area", "area in contact", derived.area),
                ("smallest_gap", "smallest gap", units.length),
                ("largest_slip", "largest slip of the last step", units.length),
                ("worn_volume", "worn volume", derived.volume),
                ("worn_depth", "largest worn depth", units.length),
                ("heat", "heat into the master", units.power),
                ("largest_flux", "largest heat flux", units.flux),
                ("largest_jump", "largest jump of the temperature", units.temperature),
            )
            if entry.get(name) is not None
        ]
    return _table((), rows, words=2) if rows else ""


def _heat(record: Record, units: Units) -> dict[str, Any]:
    """Return temperatures of bodies, and where heat comes from."""
    facts: dict[str, Any] = {
        f"temperature of {name}": f"{number(least)} to {number(largest)} {units.temperature}"
        for name, (least, largest) in (record.get("temperature") or {}).items()
    }
    balance = record.get("heat_balance") or {}
    heat = {**balance.get("parts", {}), "stored": balance.get("stored", 0.0)} if balance else {}
    facts |= {name: f"{number(value)} {units.power}" for name, value in heat.items()}
    return facts | {"error of the balance": balance.get("error")}


def status_words(pairs: Sequence[Record]) -> tuple[str, str, str]:
    """Return the words for points of status OPEN, STICK and SLIP of contact pairs, "" where there are none.

    Frictionless closed points have status SLIP: they are called closed.
    """
    laws = [pair.get("friction") or {} for pair in pairs]
    rub = [any(value for name, value in law.items() if name != "type") for law in laws]
    if all(rub):
        return "open", "stick", "slip"
    return ("open", "stick", "slip or closed") if any(rub) else ("open", "", "closed")


def _side(side: Any) -> str:
    if not isinstance(side, Mapping):
        return "?"
    if "surface" in side:
        return f"{side['body']} {side['surface']}"
    return name_in_words(str(side.get("type", "obstacle")))


def _steps(record: Record, units: Units) -> str:
    steps = (record.get("more") or {}).get("steps")
    if not isinstance(steps, Mapping) or "name" not in steps:
        return ""
    force = _derived_units(record, units).force
    named = {
        "number": "", "name": "step", "iterations": "iterations", "products": "products", "open": "open",
        "stick": "stick", "slip": "slip", "normal_force": f"sum of normal forces ({force})",
        "normal_resultant": f"their resultant ({force})",
        "friction_force": f"friction ({force})", "peak_pressure": f"largest pressure ({units.stress})",
    }  # fmt: skip
    drawn = [name for name in steps if name.startswith("preload ")]
    named |= {name: f"{name.removeprefix('preload ')} ({force})" for name in drawn}
    columns = [name for name in named if name in steps]
    rows = list(zip(*(steps[name] for name in columns), strict=True))
    return _table([named[name] for name in columns], rows, words=2)


def _motions(record: Record, units: Units) -> dict[str, str]:
    """Return displacement and rotation of the points of rigid surfaces."""
    facts: dict[str, str] = {}
    for place, entry in enumerate(record.get("rigid_motions") or ()):
        move, turn, about = (
            ", ".join(map(number, _several(entry[name]))) for name in ("displacement", "rotation", "about")
        )
        name = f"{place} {_side(entry)}, point {about}"
        facts |= {name: f"displacement {move} {units.length}; rotation {turn} rad"}
    return facts


def _springs(record: Record, units: Units) -> dict[str, str]:
    """Return force and elongation of springs between surfaces."""
    facts: dict[str, str] = {}
    for entry in (record.get("forces") or {}).get("springs") or ():
        tension, longer = (", ".join(map(number, entry[name])) for name in ("tension", "elongation"))
        force = _derived_units(record, units).force
        facts[entry["name"]] = f"tension {tension} {force}; elongation {longer} {units.length}"
    return facts


def _constraints(record: Record, units: Units) -> dict[str, str]:
    """Return the forces of linear constraints on bodies."""
    facts: dict[str, str] = {}
    for entry in (record.get("forces") or {}).get("constraints") or ():
        force = _derived_units(record, units).force
        on = [f"{each['body']} {', '.join(map(number, each['force']))} {force}" for each in entry["bodies"]]
        facts[entry["name"]] = f"{entry['equations']} equations; force on {'; '.join(on)}"
    return facts


def _forces(record: Record, units: Units) -> str:
    """Two rows for each force: itself and its moment, so that narrow screens hold them."""
    forces = record.get("forces") or {}
    if not forces:
        return ""
    scales, imbalance = scales_of(forces), forces["balance"]["imbalance"]
    names = _derived_units(record, units)
    entries = [
        (f"{what} {_side(entry)}" if "surface" in entry else what, entry)
        for what, entry in listed_forces(forces)
    ]
    rows = [row for name, entry in entries for row in _force_rows(name, entry, scales, names)]
    turned = bool((record.get("scene") or {}).get("axisymmetric"))
    twists = bool((record.get("scene") or {}).get("torsion"))
    around = "axial forces and torques" if twists else "axial forces"
    what = f"{around}{names.per}" if turned else "forces and moments"
    words = f"<p>Imbalance of all {what}: {escape(number(imbalance))}.</p>"
    return _table(("", "", *(("r", "z", "") if turned else "xyz")), rows, words=2) + words


def _force_rows(
    name: str, entry: Record, given: Mapping[str, float], units: DerivedUnits, rounding: float = 1e-8
) -> list[tuple[Any, ...]]:
    """Return a row for a force and one for its moment; none if both are zero but for rounding."""
    scales = {**given, "about": given["moment"] / given["force"] if given["force"] else 0.0}
    force, moment, about = (
        [0 if abs(part) <= rounding * scale else part for part in _several(entry[kind])]
        for kind, scale in scales.items()
    )
    if not any([*force, *moment]):
        return []
    if not moment:  # all around an axis
        return [(name, f"radial and axial force ({units.force})", *force, "")]
    if isinstance(entry["moment"], list) and len(moment) == 1:  # of bodies of revolution that may twist
        return [
            (name, f"radial and axial force ({units.force})", *force, ""),
            ("about the axis", f"torque ({units.moment})", "", "", *moment),
        ]
    # In the plane a moment is one number, about the axis across it.
    return [
        (name, f"force ({units.force})", *force, *[""] * (3 - len(force))),
        (
            f"about {', '.join(map(number, about))}",
            f"moment ({units.moment})",
            *[""] * (3 - len(moment)),
            *moment,
        ),
    ]


def _several(value: Any) -> list[Any]:
    return list(value) if isinstance(value, Sequence) else [value]


def _origin(record: Record) -> dict[str, Any]:
    facts = {"written": record.get("written"), "ranks": record.get("ranks")}
    seconds = record.get("seconds") or {}
    facts["seconds"] = ", ".join(f"{name} {spent:.2f}" for name, spent in seconds.items())
    return facts | dict(record.get("versions") or {})


@dataclass(frozen=True)
class Source:
    """The content of a page.

    `comm`: ranks that know it, None if only the calling one does.
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
        given = (self.record.get("more") or {}).get("unit_names") or {}
        return Units(**{**(self.record.get("unit_names") or {}), **given})

    def turned(self, angle: float) -> Source:
        """Return it with sections turned around the axis into hexahedra or tetrahedra, which pages cut."""

        def solid(name: str, section: pyvista.UnstructuredGrid) -> pyvista.UnstructuredGrid:
            body = turned_around(linear(name, section), angle, step=7.5)
            return body if cells_of(body).shape[1] == 8 else body.triangulate()

        check_turned(angle, bool((self.record.get("scene") or {}).get("axisymmetric")))
        steps: list[tuple[str, Mapping[str, pyvista.UnstructuredGrid]]] = []
        for label, grids in self.steps:
            steps.append((label, {name: solid(name, grid) for name, grid in grids.items()}))
        return replace(self, steps=steps)


def source_of_states(states: Mapping[str, OnBodies]) -> Source:
    """Return the fields of states by name and the record of the last one. Collective."""
    strange = [type(state).__name__ for state in states.values() if not isinstance(state, OnBodies)]
    if strange or not states:
        raise InvalidInputError(
            f"a page needs a state, states by name, or a file, got {', '.join(strange) or 'none'}"
        )
    steps: list[tuple[str, Mapping[str, pyvista.UnstructuredGrid]]] = []
    for name, state in states.items():
        blocks = state.to_pyvista()
        steps.append((name, {body: blocks[body] for body in blocks.keys()}))
    last = list(states.values())[-1]
    return Source(steps, json.loads(json_text(result_record(last))), comm=last.comm)


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
            raise InvalidInputError("the page was not written: give result_page a path")
        return str(self.path)

    def __str__(self) -> str:
        """Return the path of the file, or a text if there is none."""
        return "page without a file" if self.path is None else str(self.path)

    def _repr_mimebundle_(self, **_: Any) -> dict[str, str]:
        if self.html is None:
            return {"text/plain": ""}
        return {"text/html": _FRAME.format(page=escape(self.html)), "text/plain": str(self)}


def source_of(result: OnBodies | Mapping[str, OnBodies] | str | Path, revolved: float) -> Source:
    """Return where a page's content comes from, turned around the axis by some degrees."""
    if isinstance(result, OnBodies):
        result = {"": result}
    source = source_of_states(result) if isinstance(result, Mapping) else source_of_files(Path(result))
    return source.turned(revolved) if revolved else source


def page_of(source: Source, target: Path | None, title: str, units: Units, field: str) -> Page:
    """Make a page, and write it if there is a file to write. Collective."""
    page = None
    with nullcontext() if source.comm is None else together(source.comm):
        if source.comm is None or source.comm.rank == 0:
            page = _filled(source, title, units, field)
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
    scene = source.record.get("scene") or {}
    plane = all(map(is_plane, everything))
    turned = bool(scene.get("axisymmetric")) and not plane
    obstacles = obstacle_entries(source.record, points, turned=turned)
    data = {
        "title": title,
        "plane": plane,
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
        "status": status_words(scene.get("contacts") or ()),
        "colours": colour_scales(),
        "history": _history(source.record),
    }
    return {**data, "arrays": arrays.index}


def _first(fields: list[dict[str, Any]], name: str) -> int:
    """Return the number of the field that is shown first."""
    names = [entry["source"] for entry in fields]
    if name and name not in names:
        raise InvalidInputError(f"field must be one of {', '.join(dict.fromkeys(names))}, got {name!r}")
    return names.index(name) if name else 0


def _history(record: Mapping[str, Any]) -> dict[str, Any]:
    """Return the curves of the page: residuals, errors of meshes, and the objective of an optimisation."""
    evaluations = (record.get("optimisation") or {}).get("history") or {}
    return {
        "residuals": record.get("residual_history") or {},
        "tolerance": (record.get("solver") or {}).get("tolerance"),
        "levels": _levels(record),
        "evaluations": {
            name: evaluations[name] for name in ("evaluations", "value", "best") if name in evaluations
        },
    }


def _levels(record: Mapping[str, Any]) -> dict[str, Any]:
    """Return unknowns, seconds so far and relative errors of the meshes of a quantity, if there is one."""
    accuracy = record.get("accuracy") or {}
    levels = accuracy.get("levels") or {}
    if not levels:
        return {}
    sizes = levels.get("size", np.abs(levels["value"]).tolist())  # older records are of mechanics alone
    errors = [
        None if error is None or not size else error / size
        for error, size in zip(levels["error"], sizes, strict=True)
    ]
    seconds = np.cumsum(levels["seconds"]).tolist()
    return {
        "unknowns": levels["unknowns"], "seconds": seconds, "error": errors, "wanted": accuracy["wanted"]
    }  # fmt: skip


def _meshes(record: Record) -> str:
    """Return the meshes of a quantity that was computed to an accuracy."""
    accuracy, curves = record.get("accuracy") or {}, _levels(record)
    if not curves:
        return ""
    levels = accuracy["levels"]
    shares = ["unknown" if error is None else f"{100 * error:.2g} %" for error in curves["error"]]
    head = ("cells", "unknowns", "value", "estimated error", "products", "seconds")
    columns = [levels[name] for name in ("cells", "unknowns", "value", "products", "seconds")]
    columns.insert(3, shares)
    table = _table(head, list(zip(*columns, strict=True)), words=0)
    return f"{table}<p>{escape(accuracy['reason'])}</p>"
