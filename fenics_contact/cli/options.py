"""Options that several commands share."""

from __future__ import annotations

import json
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, TypeAlias

import typer

from fenics_contact.checkpoint import Checkpoint
from fenics_contact.errors import InvalidInputError
from fenics_contact.progress import is_visible
from fenics_contact.scene_file import SceneFile, read_scene_file

if TYPE_CHECKING:
    from fenics_contact.cli.desk import Console

SceneArgument: TypeAlias = Annotated[
    Path, typer.Argument(metavar="SCENE.toml", help="The scene file.", show_default=False)
]
OutputOption: TypeAlias = Annotated[
    Path | None,
    typer.Option("--output", "-o", help="Folder of the results instead of the file's.", show_default=False),
]
ToleranceOption: TypeAlias = Annotated[
    str | None,
    typer.Option(
        "--tolerance", help='Relative residual, or "balanced", instead of the file\'s.', show_default=False
    ),
]
SetOption: TypeAlias = Annotated[
    list[str] | None,
    typer.Option(
        "--set",
        metavar="KEY=VALUE",
        help="Another value for a key of the file, such as contacts.0.friction.coefficient=0.2; repeatable.",
        show_default=False,
    ),
]
PicturesOption: TypeAlias = Annotated[
    bool, typer.Option("--pictures/--no-pictures", help="Draw the pictures that the file requests.")
]
ResumeOption: TypeAlias = Annotated[
    bool | None,
    typer.Option(
        "--resume/--fresh",
        help="Require a checkpoint, or start anew; by default continue from one if it exists.",
        show_default=False,
    ),
]
DryOption: TypeAlias = Annotated[
    bool,
    typer.Option(
        "--dry-run",
        help="Only report what would be built and written. Python files that the scene names are run.",
    ),
]
PythonOption: TypeAlias = Annotated[
    bool,
    typer.Option("--python/--no-python", help='Run Python files that the scene names ("file.py:Name").'),
]


def read(
    console: Console,
    scene: Path,
    output: Path | None,
    tolerance: str | None,
    settings: list[str] | None,
    python: bool = True,
) -> SceneFile:
    """Read a scene file with the values that options override. Collective."""
    overrides = list(settings or ())
    if tolerance is not None:
        overrides.append(f"solver.tolerance={tolerance}")
    if output is not None:
        if not is_visible(str(output)):
            raise InvalidInputError(f"--output must be a path that can be shown, got {str(output)!r}")
        overrides.append(f"output.folder={json.dumps(str(output), ensure_ascii=False)}")
    return read_scene_file(scene, console.comm, overrides=overrides, python=python)


def checkpoint_of(file: SceneFile, resume: bool | None) -> Checkpoint | None:
    """Return the checkpoint of a long run, None if the file requests none."""
    if not file.document.output.checkpoint:
        return None
    return Checkpoint(file.folder / "checkpoint.npz", resume=resume, comm=file.comm)
