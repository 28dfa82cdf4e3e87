"""`fenics-contact run`: compute the equilibrium of a scene file, or its load steps."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from contextlib import contextmanager
from typing import Any

import numpy as np
import typer

from fenics_contact._cli.console import (
    Console,
    facts,
    forces_table,
    state_facts,
    step_row,
    step_table,
)
from fenics_contact._cli.options import checkpoint_of, forget, resumable, scene_command
from fenics_contact._cli.view import Gallery, can_draw, draw_state
from fenics_contact._scene_file.reading import SceneFile
from fenics_contact.errors import LoadStepError
from fenics_contact.output.files import only_run_in
from fenics_contact.output.paraview import ResultSeries, write_vtu, write_xdmf
from fenics_contact.output.result import forces_record, write_result
from fenics_contact.results.deformed_state import DeformedState
from fenics_contact.results.state import State

#: Largest number of load steps with maps of the status.
MAPS = 6


def add_to(app: typer.Typer) -> None:
    """Add the command to the program."""
    app.command("run", short_help="solve a scene file, or go through its load steps")(run)


def _run(console: Console, file: SceneFile, resume: bool | None, pictures: bool) -> None:
    """Compute the equilibrium of a scene file, or its load steps."""
    with only_run_in(file.folder, console.comm):
        states = _through_steps(console, file, resume) if file.steps else _at_once(console, file)
        gallery = Gallery()
        if pictures and file.document.output.pictures and can_draw(console, file, gallery):
            draw_state(console, file, states, gallery)
    names = ", ".join(["result.json", *_files(file), *(path.name for path in gallery.drawn)])
    console.write(f"results in {file.folder}/: {names}")
    gallery.require_all()


run = scene_command(_run)


def _files(file: SceneFile) -> list[str]:
    """Return the names of the files of fields to open."""
    kinds = file.document.output.files
    if file.steps:
        return ["history.pvd"] if kinds else []
    return ["state.vtm"] if "vtu" in kinds else []


def _at_once(console: Console, file: SceneFile) -> dict[str, State]:
    """Solve a scene without load steps and write its files. Collective."""
    with _keeping_last(console, file, lambda state: _write(file, state)):
        state = file.solve()
    _show(console, file, state)
    _write(file, state)
    return {file.title: state}


def _write(file: SceneFile, state: State) -> None:
    """Write the files of a scene without load steps. Collective."""
    kinds = file.document.output.files
    if "vtu" in kinds:
        write_vtu(state, file.folder)
    if "xdmf" in kinds:
        write_xdmf(state, file.folder / "state.xdmf")
    write_result(state, file.folder, more=_origin(file), errors=state.known_errors is not None)


@contextmanager
def _keeping_last(
    console: Console, file: SceneFile, write: Callable[[DeformedState], None]
) -> Iterator[None]:
    """Write the last equilibrium if a load cannot be followed to its end. Collective."""
    try:
        yield
    except LoadStepError as error:
        if error.state is not None:
            write(error.state)
            part = error.state.fractions[-1]
            console.write(f"the last equilibrium, at {part:.3g} of the load step, is in {file.folder}/")
        raise


def _show(console: Console, file: SceneFile, state: State, title: str = "") -> None:
    """Print what was found, and forces and moments. Collective."""
    console.write(facts(state_facts(state, file.document.units), title))
    console.write()
    console.write(forces_table(forces_record(state), file.document.units.model_dump()))


def _through_steps(console: Console, file: SceneFile, resume: bool | None) -> dict[str, State]:
    """Solve all load steps and write each. Collective.

    Returns some of the states by name, the last one among them.
    """
    checkpoint = checkpoint_of(file, resume)
    rows, drawn = list[dict[str, Any]](), dict[str, State]()
    chosen = set(np.unique(np.linspace(0, len(file.steps) - 1, MAPS).round().astype(int)))
    with resumable(console, checkpoint):
        sequence = file.sequence(checkpoint)
        series = ResultSeries(file.folder, "history", console.comm, formats=file.document.output.files)

        def keep(last: DeformedState) -> None:
            if file.document.output.files:
                series.add(last, last.equilibrium.time, f"{step.name}, as far as it could be followed")
            write_result(last, file.folder, more={**_origin(file), "steps": _steps(rows, file)})

        for number, step in enumerate(file.steps):
            with _keeping_last(console, file, keep):
                state = sequence.advance(step)
            if file.document.output.files:
                series.add(state, number if step.time is None else step.time, step.name)
            rows.append(step_row(number, step.name, state))
            if number in chosen:
                drawn[f"{number}: {step.name}"] = state
        sequence.finish()
    console.write(step_table(rows, file))
    _show(console, file, state, f"{file.title}: after the last step")
    more = {**_origin(file), "steps": _steps(rows, file)}
    write_result(state, file.folder, more=more, errors=state.known_errors is not None)
    forget(console, checkpoint)
    return drawn


def _origin(file: SceneFile) -> dict[str, Any]:
    units = file.document.units
    return {
        "scene_file": file.source.name,
        "title": file.title,
        "unit_names": {"length": units.length, "force": units.force, "stress": units.stress},
    }


def _steps(rows: list[dict[str, Any]], file: SceneFile) -> dict[str, list[Any]]:
    """Return the rows of load steps by columns, with their times."""
    columns = {name: [row[name] for row in rows] for name in (rows[0] if rows else ())}
    return {**columns, "time": [step.time for step in file.steps[: len(rows)]]}
