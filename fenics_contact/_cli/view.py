"""`fenics-contact view`: numbers, a picture and a web page of a result; pictures of a run."""

from __future__ import annotations

import re
from collections.abc import Callable, Mapping
from dataclasses import dataclass, field
from functools import partial, singledispatch
from pathlib import Path
from types import NoneType
from typing import Annotated, Any

import typer
from rich.table import Table

from fenics_contact._base.display import DerivedUnits
from fenics_contact._base.requirements import require_extra
from fenics_contact._cli.console import Console, console_of, facts, forces_table
from fenics_contact._scene.scene import Scene
from fenics_contact._scene_file.reading import SceneFile
from fenics_contact._scene_file.source import suggestion
from fenics_contact.errors import InvalidInputError, MissingRequirementError, agree, together
from fenics_contact.output.paraview import FIELD_FILES, fields_of_result, stored_fields
from fenics_contact.output.result import read_result
from fenics_contact.results.state import State


@dataclass
class Gallery:
    """The pictures of a run: those that were drawn, and those that could not be."""

    drawn: list[Path] = field(default_factory=list)
    missing: list[str] = field(default_factory=list)

    def require_all(self) -> None:
        """Refuse to end well without a requested picture, once everything else is written."""
        if self.missing:
            raise InvalidInputError(
                f"pictures that a scene file requests must be possible, {', '.join(self.missing)} could not "
                "be drawn, all else is written: take it out of [output] pictures, or run with --no-pictures"
            )


def can_draw(console: Console, file: SceneFile, gallery: Gallery) -> bool:
    """Return whether pictures can be drawn; if not, print what is missing for them. Collective."""
    error: Exception | None = None
    try:
        from fenics_contact.pictures.canvas import check_renderer

        if console.comm.rank == 0:
            check_renderer()
    except MissingRequirementError as missing:
        error = missing
    try:
        agree(console.comm, error)
    except MissingRequirementError as missing:
        console.write(f"no pictures: {missing}")
        output = file.document.output
        asked = output.drawn if "pictures" in output.model_fields_set else output.fields
        gallery.missing += [f"{name}.png" for name in asked]
        return False
    return True


def draw_state(
    console: Console, file: SceneFile, states: Mapping[str, State], gallery: Gallery, suffix: str = ""
) -> None:
    """Draw the pictures that a file requests. Collective."""
    from fenics_contact import pictures as viz

    state, names = list(states.values())[-1], file.document.units
    units = viz.Units(length=names.length, force=names.force, stress=names.stress)
    words: dict[str, Any] = {"title": file.title, "units": units}
    output = file.document.output
    drawings: dict[str, Callable[[Path], Any]] = {
        "stress": lambda path: viz.plot_stress(state, path, **words),
        "pressure": lambda path: viz.plot_contact_pressure(state, path, **words),
        "status": lambda path: viz.plot_contact_status(states, path, **words),
        "decomposition": lambda path: viz.plot_decomposition(
            file.scene, file.partitions, path, comm=file.comm, **words
        ),
        "error": lambda path: viz.plot_error(state, path, **words),
    }
    by_field = {name: partial(_draw_field, state, name, words) for name in output.fields}
    for name in output.drawn:
        draw = by_field[name] if name in by_field else drawings[name]
        path = file.folder / f"{name}{suffix}.png"
        try:
            draw(path)
        except InvalidInputError as error:
            console.write(f"no picture {path.name}: {error}")
            gallery.missing.append(path.name)
        else:
            gallery.drawn.append(path)


def draw_meshes(file: SceneFile, meshes: Mapping[str, Scene], gallery: Gallery) -> None:
    """Draw the meshes of scenes, those on which the way to an accuracy began and ended. Collective."""
    if not meshes:
        return
    from fenics_contact.pictures.levels import plot_meshes

    path = file.folder / "meshes.png"
    plot_meshes(meshes, path, title=file.title, comm=file.comm)
    gallery.drawn.append(path)


def _draw_field(state: State, name: str, words: dict[str, Any], path: Path) -> None:
    from fenics_contact.pictures.states import plot_field

    plot_field(state, name, path, **words)


#: Entries of a result that are shown, in this order; the others are long.
SHOWN = (
    "kind", "written", "ranks", "solver", "counts", "residuals", "energies", "errors", "seconds", "contact",
    "rigid_motions", "optimisation", "more",
)  # fmt: skip
#: Longest list that is printed in full.
LONGEST = 8
#: Largest number of evaluations that are printed.
MOST = 20


def add_to(app: typer.Typer) -> None:
    """Add the command to the program."""
    app.command("view", short_help="numbers, a picture and a web page of a result")(view)


def view(
    context: typer.Context,
    result: Annotated[
        Path,
        typer.Argument(
            metavar="RESULT",
            help="A folder of results, a result.json, or a .vtu, .vtm or .pvd file.",
            show_default=False,
        ),
    ],
    save: Annotated[
        Path | None,
        typer.Option("--save", help="PNG file to draw to, or HTML file for a web page.", show_default=False),
    ] = None,
    page: Annotated[
        bool, typer.Option("--page", help="Write page.html beside the result, to turn, cut and read.")
    ] = False,
    field: Annotated[
        str, typer.Option("--field", help="Field shown by the colours, as in the list.")
    ] = "von_mises",
    scale: Annotated[float, typer.Option("--scale", help="Factor of the displacement.")] = 1.0,
    body: Annotated[
        list[str] | None,
        typer.Option("--body", help="Body to draw, all unless given; repeatable.", show_default=False),
    ] = None,
    clip: Annotated[
        str | None,
        typer.Option(
            "--clip",
            metavar="[-]AXIS=VALUE",
            help="Cut away what lies beyond a plane: y=0 all with y > 0, -y=0 all with y < 0.",
            show_default=False,
        ),
    ] = None,
) -> None:
    """Show a result: its numbers and its fields, a picture or a web page of them."""
    console = console_of(context)
    with together(console.comm):
        if console.comm.rank == 0:
            html = save is not None and save.suffix == ".html"
            options = {"scale": scale, "bodies": body or None, "clip": None if clip is None else _plane(clip)}
            _view(console, result, None if html else save, field, options)
            if page:
                _write_page(console, result, (result if result.is_dir() else result.parent) / "page.html")
            if html and save is not None:
                _write_page(console, result, save)


def _write_page(console: Console, result: Path, target: Path) -> None:
    from fenics_contact._page.entry import result_page

    result_page(result, target)
    console.write(f"page in {target}, {target.stat().st_size / 1e6:.1f} MB: open it in a browser")


def _plane(text: str) -> tuple[tuple[float, ...], tuple[float, ...]]:
    """Return point and normal of a plane like "y=0" or "-y=2.5"."""
    match = re.fullmatch(r"([+-]?)([xyz])=(.+)", text.strip())
    try:
        if match is None:
            raise ValueError
        value = float(match[3])
    except ValueError:
        raise InvalidInputError(
            f"--clip must be an axis and a place on it, such as y=0 or -y=2.5, got {text!r}"
        ) from None
    axis = "xyz".index(match[2])
    sign = -1.0 if match[1] == "-" else 1.0
    point, normal = ([0.0] * axis + [end] + [0.0] * (2 - axis) for end in (value, sign))
    return tuple(point), tuple(normal)


def _view(console: Console, result: Path, save: Path | None, field: str, options: Mapping[str, Any]) -> None:
    """Print a result, and draw it to a file if one is given."""
    try:
        there, reason = result.exists(), "nothing is there"
    except OSError as error:
        there, reason = False, error.strerror or str(error)
    if not there:
        raise InvalidInputError(f"a result needs a folder or file that exists, got '{result}' ({reason})")
    if result.suffix in FIELD_FILES:
        fields: Path | None = result
    else:
        record = read_result(result)
        show_record(console, record)
        folder = result if result.is_dir() else result.parent
        fields = fields_of_result(folder)
        pictures = sorted(path.name for path in folder.glob("*.png"))
        if pictures:
            console.write(f"pictures in {folder}/: {', '.join(pictures)}")
    if fields is None:
        console.write("no .vtm or .pvd file of fields is there to draw")
        return
    members = stored_fields(fields)
    shown = next(member for member in members if member.value == members[-1].value)
    bodies = shown.read()
    ranges = _ranges(bodies)
    console.write(facts(ranges, f"fields of {shown.file.name}"))
    if save is None:
        return
    if field not in ranges:
        raise InvalidInputError(
            f"--field must be one of {list(ranges)}, got {field!r}: {suggestion(field, list(ranges))}choose "
            "one"
        )
    from fenics_contact.pictures.states import plot_field

    plot_field(bodies, field, save, **options)
    console.write(f"picture in {save}")


def _ranges(bodies: dict[str, Any]) -> dict[str, str]:
    """Return name -> range of every field of bodies."""
    require_extra("lists of fields", "viz", "pyvista", "matplotlib")
    from fenics_contact.pictures.canvas import Units
    from fenics_contact.pictures.section import field_entries

    ends = {entry["name"]: entry["extremes"][0] for entry in field_entries([bodies], Units())}
    return {name: f"{end[0]:.5g} to {end[1]:.5g}" if end else "" for name, end in ends.items()}


def show_record(console: Console, record: dict[str, Any]) -> None:
    """Print the entries of a result."""
    for name in SHOWN:
        value = record.get(name)
        if value in (None, {}, []):
            continue
        _show(value, name, console)
    if record.get("forces"):
        names = {"force": "force", "length": "length", **record.get("more", {}).get("unit_names", {})}
        units = DerivedUnits.of(names["force"], names["length"], record.get("scene", {}))
        console.write(forces_table(record["forces"], units))


@singledispatch
def _show(value: Any, name: str, console: Console) -> None:
    """Print an entry of a result."""
    console.write(facts({name: value}))


@_show.register(list)
def _(value: list[Any], name: str, console: Console) -> None:
    for number, part in enumerate(value):
        console.write(facts(dict(_flat(part)), f"{name} {number}"))
    console.write()


@_show.register(dict)
def _(value: dict[str, Any], name: str, console: Console) -> None:
    history = value.get("history")
    rest = {key: part for key, part in value.items() if key != "history"}
    console.write(facts(dict(_flat(rest)), name))
    console.write()
    if history:
        console.write(evaluations(history))
        console.write()


def evaluations(history: dict[str, list[Any]]) -> Table:
    """Return a table of the evaluations of an optimisation, the first and the last ones."""
    table = Table(box=None, pad_edge=False, title="evaluations", title_justify="left")
    for column in ("evaluation", "step", "value", "best"):
        table.add_column(column, justify="left" if column == "step" else "right")
    rows = list(zip(*(history[name] for name in ("evaluations", "kind", "value", "best")), strict=True))
    for number, row in enumerate(rows):
        if number == 1 and len(rows) > MOST:
            table.add_row("...")
        if number == 0 or number > len(rows) - MOST:
            table.add_row(*map(_number, row))
    return table


@singledispatch
def _flat(value: Any, name: str = "") -> list[tuple[str, str]]:
    """Return the parts of a nested entry by dotted names."""
    return [(name, _number(value))]


@_flat.register(dict)
def _(value: dict[str, Any], name: str = "") -> list[tuple[str, str]]:
    parts = [_flat(part, f"{name}.{key}" if name else str(key)) for key, part in value.items()]
    return [row for rows in parts for row in rows]


@_flat.register(list)
def _(value: list[Any], name: str = "") -> list[tuple[str, str]]:
    shown = ", ".join(_number(part) for part in value[:LONGEST])
    return [(name, f"{shown}, ... ({len(value)} in all)" if len(value) > LONGEST else shown)]


@singledispatch
def _number(value: Any) -> str:
    return str(value)


_number.register(NoneType, lambda value: "")
_number.register(float, lambda value: f"{value:.6g}")
