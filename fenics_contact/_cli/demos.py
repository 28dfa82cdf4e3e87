"""`fenics-contact demo`: list, run or copy the demos of the package."""

from __future__ import annotations

import re
import runpy
import shutil
import sys
from pathlib import Path
from typing import Annotated

import typer
from rich.table import Table

from fenics_contact._cli.console import Console, console_of, redirect_to_devnull
from fenics_contact._cli.optimize import optimize
from fenics_contact._cli.run import run
from fenics_contact._scene_file.source import suggestion
from fenics_contact.errors import InvalidInputError, together


def add_to(app: typer.Typer) -> None:
    """Add the command to the program."""
    extra = {"allow_extra_args": True, "ignore_unknown_options": True}
    app.command("demo", context_settings=extra, short_help="list, run or copy a demo")(demo)


def demo(
    context: typer.Context,
    name: Annotated[
        str | None,
        typer.Argument(metavar="NAME", help="Name of a demo; without it all are listed.", show_default=False),
    ] = None,
    copy: Annotated[bool, typer.Option("--copy", help="Only copy its file into this folder.")] = False,
) -> None:
    """List the demos, or run one; further arguments are passed to it (--size small).

    Names that end in .toml are example scenes, in .inp decks. Results go to output/NAME in this folder.
    """
    console, there = console_of(context), shipped()
    if name is None:
        _list(console, there)
        return
    if name not in there:
        raise InvalidInputError(
            f"a demo is one of {list(there)}, got {name!r}: {suggestion(name, there)}choose one"
        )
    chosen = there[name]
    if copy:
        _copy(console, chosen)
    elif chosen.suffix == ".py":
        _run(chosen, list(context.args))
    elif context.args:
        raise InvalidInputError(
            f"a scene takes no options here, got {context.args}: copy it with `fenics-contact demo {name} "
            f"--copy` and use `fenics-contact {_command(chosen)} {name}`"
        )
    else:
        (optimize if _command(chosen) == "optimize" else run)(context, chosen)


def folder_of_demos() -> Path:
    """Return the folder of the demos: beside the package in a checkout, inside it if installed."""
    package = Path(__file__).resolve().parents[1]
    for folder in (package.parent / "demos", package / "demos"):
        if any(folder.glob("demo_*.py")):
            return folder
    raise InvalidInputError(f"demos must lie in 'demos' in or beside {package}: install the package again")


def shipped() -> dict[str, Path]:
    """Return the files of all demos, scenes and decks by name; those of scenes and decks with suffix."""
    folder = folder_of_demos()
    demos = {path.stem.removeprefix("demo_"): path for path in sorted(folder.glob("demo_*.py"))}
    files = (*sorted(folder.glob("scenes/*.toml")), *sorted(folder.glob("decks/*.inp")))
    return demos | {path.name: path for path in files}


def _list(console: Console, there: dict[str, Path]) -> None:
    """Print names and titles: the first line of text up to its first full stop."""
    table = Table(box=None, pad_edge=False, show_header=False)
    table.add_column(style="bold", no_wrap=True)
    table.add_column()
    for name, path in there.items():
        text = path.read_text(encoding="utf-8")
        options = sorted(set(re.findall(r'"(--[a-z-]+)"', text))) if path.suffix == ".py" else []
        lines = re.findall(r"^(?:#|\*\*)[# ]* (\S.*)$", text, re.MULTILINE)
        title = re.split(r"[.;](?: |$)", next(iter(lines), ""))
        table.add_row(name, f"{title[0]} ({' '.join(options)})" if options else title[0])
    console.write(table)
    console.write("run one with `fenics-contact demo NAME`, copy its file to change it with --copy")


def _copy(console: Console, chosen: Path) -> None:
    target = Path.cwd() / chosen.name
    with together(console.comm):
        if console.comm.rank == 0:
            if target.exists():
                raise InvalidInputError(f"{target.name!r} is there already: remove it, or copy elsewhere")
            shutil.copyfile(chosen, target)
            schema = chosen.parent / "scene_file.schema.json"
            if chosen.suffix == ".toml" and schema.exists() and not (target.parent / schema.name).exists():
                shutil.copyfile(schema, target.parent / schema.name)
    program = "python" if chosen.suffix == ".py" else f"fenics-contact {_command(chosen)}"
    console.write(f"copied to {target.name}; run it with `{program} {target.name}`")


def _command(scene: Path) -> str:
    """Return the command that an example scene is for."""
    text = scene.read_text(encoding="utf-8")
    return "optimize" if re.search(r"^\[\[?design", text, re.MULTILINE) else "run"


def _run(chosen: Path, arguments: list[str]) -> None:
    """Run a demo; it ends where the reader of its output has gone."""
    before = sys.argv
    sys.argv = [str(chosen), *arguments]
    try:
        runpy.run_path(str(chosen), run_name="__main__")
        sys.stdout.flush()
    except BrokenPipeError:
        redirect_to_devnull(sys.stdout)
    except SystemExit as end:
        if isinstance(end.code, str):  # a demo with wrong options exits with a message
            raise InvalidInputError(end.code) from end
        if end.code:
            raise typer.Exit(end.code) from end
    finally:
        sys.argv = before
