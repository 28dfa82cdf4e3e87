"""`fenics-contact convert`: a deck of CalculiX or Abaqus as a scene file."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

import typer

from fenics_contact._cli.console import console_of
from fenics_contact.errors import together


def add_to(app: typer.Typer) -> None:
    """Add the command to the program."""
    app.command("convert", short_help="write a deck of CalculiX or Abaqus as a scene file")(convert)


def convert(
    context: typer.Context,
    deck: Annotated[Path, typer.Argument(metavar="MODEL.inp", help="The deck.", show_default=False)],
    scene: Annotated[
        Path | None,
        typer.Argument(metavar="SCENE.toml", help="The scene file, by default beside the deck."),
    ] = None,
    statics_only: Annotated[
        bool,
        typer.Option("--statics-only", help="Leave out the first step that is no statics and all behind it."),
    ] = False,
) -> None:
    """Write a deck as a scene file and its mesh, which have the same answer."""
    from fenics_contact.decks.convert import write_scene_file
    from fenics_contact.decks.deck import read_deck

    console = console_of(context)
    read = read_deck(deck, console.comm, statics_only=statics_only)
    files = list[Path]()
    with together(console.comm):
        if console.comm.rank == 0:
            files = write_scene_file(read, scene or deck.with_suffix(".toml"))
    for words in read.notes:
        console.write(f"! {words}")
    console.write(f"{deck.name} as a scene file in {', '.join(map(str, files))}")
