"""`fenics-contact view`: numbers, a picture and a web page of a result."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path
from typing import Annotated, Any

import typer
from rich.table import Table

from fenics_contact._requirements import require_extra
from fenics_contact.cli.desk import Console, console_of, facts
from fenics_contact.cli.forces import forces_table
from fenics_contact.errors import InvalidInputError, together
from fenics_contact.io import FIELD_FILES, fields_of_result, read_result, stored_fields
from fenics_contact.scene_file import suggestion

#: Entries of a result that are shown, in this order; the others are long.
SHOWN = (
    "kind", "written", "ranks", "solver", "counts", "residuals", "energies", "errors", "seconds", "contact",
    "rigid_motions", "optimisation", "more",
)  # fmt: skip
#: Longest list that is printed in full, and largest number of evaluations.
LONGEST, MOST = 8, 20


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
        Path | None, typer.Option("--save", help="PNG file to draw to.", show_default=False)
    ] = None,
    page: Annotated[
        str | None,
        typer.Option(
            "--page",
            metavar="[FILE.html]",
            help="Write a web page to turn, cut and read, page.html beside the result unless named.",
            show_default=False,
        ),
    ] = None,
    field: Annotated[
        str,
        typer.Option("--field", help="Field shown by the colours, as in the list."),
    ] = "von_mises",
    scale: Annotated[float, typer.Option("--scale", help="Factor of the displacement.")] = 1.0,
) -> None:
    """Show a result: its numbers and its fields; --save draws a picture, --page makes a web page."""
    console = console_of(context)
    with together(console.comm):
        if console.comm.rank == 0:
            _view(console, result, save, field, scale)
            if page is not None:
                _write_page(console, result, page)


def with_page_named(arguments: Sequence[str]) -> list[str]:
    """Give --page of this command an empty value where no file follows it, as the library wants one."""
    command = next((word for word in arguments if not word.startswith("-")), "")
    if command != "view":
        return list(arguments)
    named = [*arguments[1:], ""]
    return [
        f"{word}=" if word == "--page" and not after.endswith(".html") else word
        for word, after in zip(arguments, named, strict=True)
    ]


def _write_page(console: Console, result: Path, name: str) -> None:
    from fenics_contact.page import result_page

    target = Path(name) if name else (result if result.is_dir() else result.parent) / "page.html"
    result_page(result, target)
    console.say(f"page in {target}, {target.stat().st_size / 1e6:.1f} MB: open it in a browser")


def _view(console: Console, result: Path, save: Path | None, field: str, scale: float) -> None:
    """Print a result, and draw it to a file if one is given."""
    try:
        there, reason = result.exists(), "nothing is there"
    except OSError as error:
        there, reason = False, error.strerror or str(error)
    if not there:
        raise InvalidInputError(
            f"a result needs a folder or file that exists, got '{result}' ({reason}): correct the path"
        )
    if result.suffix in FIELD_FILES:
        fields: Path | None = result
    else:
        record = read_result(result)
        show_record(console, record)
        folder = result if result.is_dir() else result.parent
        fields = fields_of_result(folder)
        pictures = sorted(path.name for path in folder.glob("*.png"))
        if pictures:
            console.say(f"pictures in {folder}/: {', '.join(pictures)}")
    if fields is None:
        console.say("no .vtm or .pvd file of fields is there to draw")
        return
    members = stored_fields(fields)
    shown = next(member for member in members if member.value == members[-1].value)
    bodies = shown.read()
    ranges = _ranges(bodies)
    console.show(facts(ranges, f"fields of {shown.file.name}"))
    if save is None:
        return
    if field not in ranges:
        raise InvalidInputError(
            f"--field must be one of {list(ranges)}, got {field!r}: {suggestion(field, list(ranges))}choose "
            "one of them"
        )
    from fenics_contact.viz import plot_field

    plot_field(bodies, field, save, scale=scale)
    console.say(f"picture in {save}")


def _ranges(bodies: dict[str, Any]) -> dict[str, str]:
    """Return name -> range of every field of bodies."""
    require_extra("lists of fields", "viz", "pyvista", "matplotlib")
    from fenics_contact.viz import Units, field_entries

    ends = {entry["name"]: entry["extremes"][0] for entry in field_entries([bodies], Units())}
    return {name: f"{end[0]:.5g} to {end[1]:.5g}" if end else "" for name, end in ends.items()}


def show_record(console: Console, record: dict[str, Any]) -> None:
    """Print the entries of a result."""
    for name in SHOWN:
        value = record.get(name)
        if value in (None, {}, []):
            continue
        if isinstance(value, dict):
            history = value.get("history")
            rest = {key: part for key, part in value.items() if key != "history"}
            console.show(facts(dict(_flat(rest)), name))
            console.say()
            if history:
                console.show(evaluations(history))
                console.say()
        elif isinstance(value, list):
            for number, part in enumerate(value):
                console.show(facts(dict(_flat(part)), f"{name} {number}"))
            console.say()
        else:
            console.show(facts({name: value}))
    if record.get("forces"):
        console.show(forces_table(record["forces"], record.get("more", {}).get("unit_names")))


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


def _flat(value: Any, name: str = "") -> list[tuple[str, str]]:
    """Return the parts of a nested entry by dotted names."""
    if isinstance(value, dict):
        parts = [_flat(part, f"{name}.{key}" if name else str(key)) for key, part in value.items()]
        return [row for rows in parts for row in rows]
    if isinstance(value, list):
        shown = ", ".join(_number(part) for part in value[:LONGEST])
        return [(name, f"{shown}, ... ({len(value)} in all)" if len(value) > LONGEST else shown)]
    return [(name, _number(value))]


def _number(value: Any) -> str:
    if value is None:
        return ""
    return f"{value:.6g}" if isinstance(value, float) else str(value)
