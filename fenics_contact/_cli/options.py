"""What several commands share: options, the preview of a run, interruption and continuation."""

from __future__ import annotations

import inspect
import json
from collections.abc import Callable, Iterator, Sequence
from contextlib import contextmanager
from functools import partial
from pathlib import Path
from typing import Annotated, TypeAlias

import typer

from fenics_contact._base.checkpoint import Checkpoint, interruptible
from fenics_contact._base.display import counted
from fenics_contact._base.progress import is_visible, show_progress
from fenics_contact._cli.console import Console, console_of, facts, write_stderr
from fenics_contact._scene_file.entry import read_scene_file
from fenics_contact._scene_file.reading import SceneFile
from fenics_contact.errors import ConvergenceError, InfeasibleError, InvalidInputError

Command: TypeAlias = Callable[..., None]
#: Suffixes of decks of CalculiX and Abaqus.
DECKS = (".inp",)


def scene_command(
    compute: Callable[[Console, SceneFile, bool | None, bool], None],
    *,
    check: Callable[[SceneFile], None] = lambda file: None,
    plan: Callable[[SceneFile], dict[str, str]],
    accurate: Sequence[str] = (),
) -> Command:
    """Return the command that reads a scene file, checks it, prints its plan and computes.

    ``compute`` takes whether to resume, and whether to draw; its docstring is that of the command; ``plan``:
    what it prints of the plan, see `plan_of_states`; ``accurate``: names of the options that ask for an
    accuracy, those it has of ``accuracy`` and ``of``.
    """

    def command(
        context: typer.Context,
        scene: Annotated[
            Path,
            typer.Argument(
                metavar="SCENE.toml", help="The scene file, or a deck (.inp).", show_default=False
            ),
        ],
        output: Annotated[
            Path | None,
            typer.Option(
                "--output", "-o", help="Folder of the results instead of the file's.", show_default=False
            ),
        ] = None,
        tolerance: Annotated[
            str | None,
            typer.Option(
                "--tolerance",
                help='Relative residual, or "balanced", instead of the file\'s.',
                show_default=False,
            ),
        ] = None,
        settings: Annotated[
            list[str] | None,
            typer.Option(
                "--set",
                metavar="KEY=VALUE",
                help="Another value for a key of the file, such as contacts.0.friction.coefficient=0.2; "
                "repeatable.",
                show_default=False,
            ),
        ] = None,
        accuracy: Annotated[
            str | None,
            typer.Option(
                "--accuracy",
                metavar="1%",
                help="Refine the meshes until a quantity, or the objective of a design, has this relative "
                "error, as 1% or 0.01.",
                show_default=False,
            ),
        ] = None,
        of: Annotated[
            str | None,
            typer.Option(
                "--of",
                metavar="QUANTITY",
                help="The quantity of --accuracy by its name, by default the file's or peak_pressure.",
                show_default=False,
            ),
        ] = None,
        pictures: Annotated[
            bool, typer.Option("--pictures/--no-pictures", help="Draw the pictures that the file requests.")
        ] = True,
        resume: Annotated[
            bool | None,
            typer.Option(
                "--resume/--fresh",
                help="Require a checkpoint, or start anew; by default continue from one if it exists.",
                show_default=False,
            ),
        ] = None,
        dry_run: Annotated[
            bool,
            typer.Option(
                "--dry-run",
                "--plan",
                help="Only report what would be built and written. Python files that the scene names are "
                "run.",
            ),
        ] = False,
        python: Annotated[
            bool,
            typer.Option(
                "--python/--no-python", help='Run Python files that the scene names ("file.py:Name").'
            ),
        ] = True,
        statics_only: Annotated[
            bool,
            typer.Option(
                "--statics-only",
                help="Of a deck: leave out the first step that is no statics and all behind it.",
            ),
        ] = False,
    ) -> None:
        console = console_of(context)
        with show_progress(console.comm):
            overrides = [*(settings or ()), *_asked(accuracy, of), *_overridden(tolerance, output)]
            if scene.suffix.lower() in DECKS:
                from fenics_contact.decks.deck import read_deck
                from fenics_contact.decks.file import read_deck_file

                read = partial(read_deck, statics_only=True) if statics_only else read_deck
                file = read_deck_file(scene, console.comm, overrides, read)
            elif statics_only:
                raise InvalidInputError(f"--statics-only is of decks, got the scene file {str(scene)!r}")
            else:
                file = read_scene_file(scene, console.comm, overrides=overrides, python=python)
            check(file)
            _show_plan(console, file, plan(file))
            console.write()
            if dry_run:
                drawn = file.document.output.drawn if pictures else []
                refines = bool(accurate) and file.document.accuracy is not None
                _show_outputs(console, file, [*drawn, *(["meshes"] if drawn and refines else [])])
            else:
                compute(console, file, resume, pictures)

    command.__doc__ = compute.__doc__
    whole, others = inspect.signature(command, eval_str=True), {"accuracy", "of"} - set(accurate)
    kept = [each for name, each in whole.parameters.items() if name not in others]
    command.__signature__ = whole.replace(parameters=kept)  # type: ignore[attr-defined]
    return command


def _asked(accuracy: str | None, of: str | None) -> list[str]:
    """Return the keys of a scene file that ask for an accuracy."""
    asked = []
    if accuracy is not None:
        share = accuracy.strip().removesuffix("%")
        try:
            error = float(share) / (100.0 if share != accuracy.strip() else 1.0)
        except ValueError:
            error = float("nan")
        if not 0.0 < error < 1.0:
            raise InvalidInputError(
                f"--accuracy must lie between 0 and 1, or 0% and 100%, got {accuracy!r}: 1% or 0.01 are usual"
            )
        asked.append(f"accuracy.relative_error={error!r}")
    if of is not None:
        asked.append(f"accuracy.quantity={json.dumps(of, ensure_ascii=False)}")
    return asked


def _overridden(tolerance: str | None, output: Path | None) -> list[str]:
    """Return the keys of a scene file with the values of options."""
    keys = []
    if tolerance is not None:
        keys.append(f"solver.tolerance={tolerance}")
    if output is not None:
        if not is_visible(str(output)):
            raise InvalidInputError(f"--output must be a path that can be shown, got {str(output)!r}")
        keys.append(f"output.folder={json.dumps(str(output), ensure_ascii=False)}")
    return keys


def checkpoint_of(file: SceneFile, resume: bool | None) -> Checkpoint | None:
    """Return the checkpoint of a long run, None if the file requests none."""
    if not file.document.output.checkpoint:
        return None
    return Checkpoint(file.folder / "checkpoint.npz", resume=resume, comm=file.comm)


def forget(console: Console, checkpoint: Checkpoint | None) -> None:
    """Remove the checkpoint of a complete run: the next one starts anew."""
    if checkpoint is not None and console.comm.rank == 0:
        Path(checkpoint.path).unlink(missing_ok=True)


def plan_of_states(file: SceneFile) -> dict[str, str]:
    """Return what is solved, name -> words. Collective."""
    rows = {name: words for plan in file.plans for name, words in _rows(plan).items()}
    if file.steps:
        rows[file.steps_in_words] = str(len(file.steps))
    halvings = file.document.solver.halvings
    if halvings:
        cells = 2 ** (halvings * file.scene.dim) * sum(b.mesh.n_cells for b in file.scene.deforming.values())
        times = counted(halvings, "time")
        rows["cells halved"] = f"{times}, to {cells} cells; all else is of the first meshes"
    asked = file.document.accuracy
    return rows if asked is None else rows | {"accuracy": asked.in_words}


def plan_of_design(file: SceneFile) -> dict[str, str]:
    """Return what is solved for derivatives by shapes, name -> words. Collective."""
    rows = _rows(file.scene.plan(file.partitions, sensitivity=True))
    asked = file.document.accuracy
    if asked is None:
        return rows
    return rows | {"accuracy": f"objective{asked.in_words.removeprefix(str(asked.quantity))}"}


def _rows(plan: object) -> dict[str, str]:
    return {line[:15].strip(): line[16:] for line in str(plan).splitlines()}


def _show_plan(console: Console, file: SceneFile, rows: dict[str, str]) -> None:
    """Print the plan of a scene. Collective."""
    console.write(f"{file.title}: {file.source.name} on {console.ranks}")
    console.write(facts(rows))
    for words in file.notes:
        console.write(f"! {words}")


def _show_outputs(console: Console, file: SceneFile, drawn: Sequence[str]) -> None:
    """Report what a run would write, and what it would draw."""
    output = file.document.output
    pictures = f", pictures of {', '.join(drawn)}" if drawn else ""
    kinds = f", {', '.join(output.files)} files" if output.files else ""
    shapes = (
        f", {', '.join(output.design)} files of the design" if file.document.design and output.design else ""
    )
    console.write(f"would write to {file.folder}/: result.json{kinds}{shapes}{pictures}")
    console.write("nothing was solved, this is the plan")


@contextmanager
def resumable(console: Console, checkpoint: Checkpoint | None) -> Iterator[None]:
    """Let signals stop the block where it can continue, and report how to continue an incomplete run.

    Collective.
    """
    with interruptible(console.comm), _reporting(console, checkpoint):
        yield


@contextmanager
def _reporting(console: Console, checkpoint: Checkpoint | None) -> Iterator[None]:
    if checkpoint is None:
        yield
        return
    path = Path(checkpoint.path)
    resumed = path.exists() and checkpoint.resume is not False
    if resumed:
        console.write(f"going on from {path} (--fresh starts anew)")
    try:
        yield
    except InvalidInputError as error:
        if resumed:
            raise InvalidInputError(f"{error} (with --fresh the run starts anew)") from error
        raise
    except (ConvergenceError, InfeasibleError):
        if console.comm.rank == 0 and path.exists():
            write_stderr(f"what is done is kept in {path}; the same command goes on from there\n")
        raise
