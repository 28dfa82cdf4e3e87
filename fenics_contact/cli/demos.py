"""`fenics-contact demo`: list, run or copy the demos of the package."""

from __future__ import annotations

import contextlib
import runpy
import shutil
import sys
from pathlib import Path
from typing import Annotated

import typer
from rich.table import Table

from fenics_contact.cli.desk import Desk, desk_of
from fenics_contact.cli.optimize import optimize
from fenics_contact.cli.run import run
from fenics_contact.cli.shipped import Shipped, optimises, shipped, takes
from fenics_contact.cli.streams import Unread
from fenics_contact.errors import InvalidInputError, together
from fenics_contact.scene_file import suggestion


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

    Names that end in .toml are example scenes. Results go to output/NAME in the current folder.
    """
    desk, there = desk_of(context), shipped()
    if name is None:
        _list(desk, there)
        return
    if name not in there:
        raise InvalidInputError(
            f"a demo is one of {list(there)}, got {name!r}: {suggestion(name, there)}`fenics-contact demo` "
            "lists them"
        )
    chosen = there[name]
    if copy:
        _copy(desk, chosen)
    elif chosen.is_scene:
        if context.args:
            raise InvalidInputError(
                f"a scene takes no options here, got {context.args}: copy it with `fenics-contact demo "
                f"{name} --copy` and use `fenics-contact {_command(chosen)} {name}`"
            )
        (optimize if optimises(chosen.path) else run)(context, chosen.path)
    else:
        _run(desk, chosen, list(context.args))


def _list(desk: Desk, there: dict[str, Shipped]) -> None:
    table = Table(box=None, pad_edge=False, show_header=False)
    table.add_column(style="bold", no_wrap=True)
    table.add_column()
    for one in there.values():
        options = [] if one.is_scene else takes(one.path)
        table.add_row(one.name, f"{one.title}{f' ({chr(32).join(options)})' if options else ''}")
    desk.show(table)
    desk.say("run one with `fenics-contact demo NAME`, copy its file to change it with --copy")


def _copy(desk: Desk, chosen: Shipped) -> None:
    target = Path.cwd() / chosen.path.name
    with together(desk.comm):
        if desk.comm.rank == 0:
            if target.exists():
                raise InvalidInputError(f"{target.name!r} is there already: remove it, or copy elsewhere")
            shutil.copyfile(chosen.path, target)
            schema = chosen.path.parent / "scene_file.schema.json"
            if chosen.is_scene and schema.exists() and not (target.parent / schema.name).exists():
                shutil.copyfile(schema, target.parent / schema.name)
    program = f"fenics-contact {_command(chosen)}" if chosen.is_scene else "python"
    desk.say(f"copied to {target.name}; run it with `{program} {target.name}`")


def _command(scene: Shipped) -> str:
    """Return the command that an example scene is for."""
    return "optimize" if optimises(scene.path) else "run"


def _run(desk: Desk, chosen: Shipped, arguments: list[str]) -> None:
    before = sys.argv
    sys.argv = [str(chosen.path), *arguments]
    try:
        with contextlib.redirect_stdout(Unread(sys.stdout)):
            runpy.run_path(str(chosen.path), run_name="__main__")
            sys.stdout.flush()
    except SystemExit as end:
        if isinstance(end.code, str):  # a demo with wrong options exits with a message
            raise InvalidInputError(end.code) from end
        if end.code:
            raise typer.Exit(end.code) from end
    finally:
        sys.argv = before
