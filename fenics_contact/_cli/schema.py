"""`fenics-contact schema`: the JSON schema of scene files, for editors."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

import typer

from fenics_contact._cli.console import console_of
from fenics_contact._scene_file.validation import json_schema
from fenics_contact.output.files import json_text, write_json


def add_to(app: typer.Typer) -> None:
    """Add the command to the program."""
    app.command("schema", short_help="JSON schema of scene files, for editors")(schema)


def schema(
    context: typer.Context,
    file: Annotated[
        Path | None,
        typer.Argument(metavar="FILE", help="File to write; stdout unless given.", show_default=False),
    ] = None,
) -> None:
    """Write the JSON schema of scene files, which editors use for completion and checks.

    A scene file whose first line is "#:schema scene_file.schema.json" is checked while it is edited, by taplo
    or the extension Even Better TOML.
    """
    console = console_of(context)
    if file is None:
        console.say(json_text(json_schema()).rstrip())
        return
    write_json(file, json_schema(), comm=console.comm)
    console.say(f"schema of scene files in {file}")
