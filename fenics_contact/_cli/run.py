"""`fenics-contact run`: compute the equilibrium of a scene file, or its load steps."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Mapping
from contextlib import contextmanager
from dataclasses import dataclass, field
from functools import singledispatch
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np
import typer

from fenics_contact._adaptive.levels import AccurateResult, Level
from fenics_contact._base.display import DerivedUnits, counted
from fenics_contact._cli.console import (
    Console,
    ExitCode,
    facts,
    forces_table,
    state_facts,
    step_table,
)
from fenics_contact._cli.options import checkpoint_of, forget, plan_of_states, resumable, scene_command
from fenics_contact._cli.view import Gallery, can_draw, draw_meshes, draw_state
from fenics_contact._scene.scene import Scene
from fenics_contact._scene_file.heat import HeatedFile, HeatFile
from fenics_contact._scene_file.reading import SceneFile
from fenics_contact.errors import LoadStepError
from fenics_contact.output.files import only_run_in
from fenics_contact.output.heat import write_heat_balance
from fenics_contact.output.paraview import ResultSeries, write_vtu, write_xdmf
from fenics_contact.output.result import forces_record, write_result
from fenics_contact.output.tables import StepTable, step_row, write_contact_table
from fenics_contact.results.deformed_state import DeformedState
from fenics_contact.results.on_bodies import OnBodies
from fenics_contact.results.state import State

if TYPE_CHECKING:
    from fenics_contact.heat.state import HeatState

#: Largest number of load steps with maps of the status.
MAPS = 6
#: A line of the table of meshes.
LEVEL = "{:>9s} {:>9s} {:>12s} {:>8s} {:>8s} {:>8s} {:>8s}"


def add_to(app: typer.Typer) -> None:
    """Add the command to the program."""
    app.command("run", short_help="solve a scene file, or go through its load steps")(run)


@dataclass(frozen=True, eq=False)
class Found:
    """States by their titles.

    `meshes`: scenes whose meshes are drawn, by their titles; `missed`: why an accuracy was not reached.
    """

    states: dict[str, State]
    meshes: Mapping[str, Scene] = field(default_factory=dict)
    missed: str = ""


def _run(console: Console, file: SceneFile, resume: bool | None, pictures: bool) -> None:
    """Compute the equilibrium of a scene file, or its load steps."""
    with only_run_in(file.folder, console.comm):
        found = _computed(file, console, resume)
        gallery = Gallery()
        if pictures and file.document.output.drawn and can_draw(console, file, gallery):
            draw_state(console, file, found.states, gallery)
            draw_meshes(file, found.meshes, gallery)
    names = ", ".join(["result.json", *_files(file), *(path.name for path in gallery.drawn)])
    console.write(f"results in {file.folder}/: {names}")
    gallery.require_all()
    if found.missed:
        console.write(f"the accuracy was not reached: {found.missed}")
        raise typer.Exit(int(ExitCode.NOT_CONVERGED))


@singledispatch
def _computed(file: SceneFile, console: Console, resume: bool | None) -> Found:
    """Compute what a file asks for, print and write it. Collective."""
    if file.document.accuracy is not None:
        return _to_accuracy(console, file)
    return Found(_through_steps(console, file, resume) if file.steps else _at_once(console, file))


@_computed.register
def _(file: HeatFile, console: Console, resume: bool | None) -> Found:
    if file.steps:
        return Found({file.title: _over_time(console, file)})
    found: Any = file.solve()
    _keep_heat(console, file, found, file.folder)
    return Found({file.title: found})


def _over_time(console: Console, file: HeatFile) -> Any:
    """Print and write states over time, and return the last one. Collective."""
    kinds, series, rows = file.document.output.files, _series(file), list[tuple[float, Any]]()
    for number, (time, state, heat) in enumerate(file.followed(console.write)):
        if file.document.output.field_files:
            series.add(state, time, f"time {time:g}")
        if "csv" in kinds and state.geometry.contacts:
            write_contact_table(state, file.folder / "contact" / f"step_{number:04d}.csv")
        rows += [(time, each) for each in heat]
    if "csv" in kinds and rows:
        times, warm = zip(*rows, strict=True)
        write_heat_balance(warm, file.folder / "steps.csv", times)
    write_result(state, file.folder, more=_origin(file))
    return state


def _series(file: SceneFile) -> ResultSeries:
    return ResultSeries(file.folder, "history", file.comm, formats=file.document.output.field_files)


@_computed.register
def _(file: HeatedFile, console: Console, resume: bool | None) -> Found:
    state = file.solve()
    console.write(
        f"heat and mechanics agree after {counted(state.passes, 'pass', 'passes')}, from {state.start}"
    )
    _show(console, file, state.mechanics)
    _write(file, state.mechanics)
    _keep_heat(console, file, state.heat, file.folder / "heat")
    return Found({file.title: state.mechanics})


def _keep_heat(console: Console, file: SceneFile, state: HeatState, folder: Path) -> None:
    """Print temperatures and where heat comes from, and write them. Collective."""
    console.write(f"{state}\n{state.balance}")
    _write_fields(file, state, folder)
    if "csv" in file.document.output.files:
        write_heat_balance([state], folder / "steps.csv")
    write_result(state, folder, more=_origin(file))


run = scene_command(_run, plan=plan_of_states, check=SceneFile.check_accuracy, accurate=("accuracy", "of"))


def _files(file: SceneFile) -> list[str]:
    """Return the names of the files to open."""
    output, names = file.document.output, list[str]()
    if "vtu" in output.files or (file.steps and output.field_files):
        names.append("history.pvd" if file.steps else "state.vtm")
    if "csv" in output.files:
        names.append("steps.csv")
        if file.scene.contacts:
            names.append("contact/" if file.steps else "contact.csv")
    return names


def _at_once(console: Console, file: SceneFile) -> dict[str, State]:
    """Solve a scene without load steps and write its files. Collective."""
    with _keeping_last(console, file, lambda state: _write(file, state)):
        state = file.solve()
    _show(console, file, state)
    _write(file, state)
    return {file.title: state}


def _to_accuracy(console: Console, file: SceneFile) -> Found:
    """Solve on finer and finer meshes, print a line for each, and write the files. Collective."""
    result = file.solve_to(table_of_levels(console))
    console.write(f"{result.reason}\n")
    _show(console, file, result.state)
    _write(file, result.state, result)
    meshes = {"first": file.scene, "last": result.state.scene}
    return Found({file.title: result.state}, meshes, "" if result.reached else result.reason)


def table_of_levels(console: Console) -> Callable[[Level], None]:
    """Print the head of a table of meshes, and return what prints a line of it."""
    console.write(LEVEL.format("cells", "unknowns", "value", "error", "products", "seconds", "expected"))
    return lambda level: console.write(LEVEL.format(*level.in_words))


def _write(file: SceneFile, state: State, accurate: AccurateResult[State] | None = None) -> None:
    """Write the files of a scene without load steps. Collective."""
    _write_fields(file, state, file.folder)
    if "csv" in file.document.output.files:
        StepTable(file.folder / "steps.csv", file.comm).add(state, file.title)
    file.write_tables(state)
    known = state.known_errors is not None
    write_result(state, file.folder, more=_origin(file), errors=known, accuracy=accurate)


def _write_fields(file: SceneFile, state: OnBodies, folder: Path) -> None:
    """Write fields and contact points. Collective."""
    kinds = file.document.output.files
    if "vtu" in kinds:
        write_vtu(state, folder)
    if "xdmf" in kinds:
        write_xdmf(state, folder / "state.xdmf")
    if "csv" in kinds and state.geometry.contacts:
        write_contact_table(state, folder / "contact.csv")


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
    names = file.document.units
    units = DerivedUnits.of(names.force, names.length, state.scene.dimension_record)
    console.write(forces_table(forces_record(state), units))


def _through_steps(console: Console, file: SceneFile, resume: bool | None) -> dict[str, State]:
    """Solve all load steps and write each. Collective.

    Returns some of the states by name, the last one among them.
    """
    checkpoint = checkpoint_of(file, resume)
    rows, drawn = list[dict[str, Any]](), dict[str, State]()
    chosen = set(np.unique(np.linspace(0, len(file.steps) - 1, MAPS).round().astype(int)))
    with resumable(console, checkpoint):
        sequence, keep = file.sequence(checkpoint), _writer(console, file)

        def keep_last(last: DeformedState) -> None:
            keep(last, len(rows), last.equilibrium.time, f"{step.name}, as far as it could be followed")
            write_result(last, file.folder, more={**_origin(file), "steps": _steps(rows, file)})

        for number, step in enumerate(file.steps):
            with _keeping_last(console, file, keep_last):
                state = sequence.advance(step)
            keep(state, number, number if step.time is None else step.time, step.name)
            file.write_tables(state, number)
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


def _writer(console: Console, file: SceneFile) -> Callable[[State, int, float, str], None]:
    """Return what writes the files of a load step: its state, number, time and name. Collective."""
    output = file.document.output
    series = _series(file)
    table = StepTable(file.folder / "steps.csv", console.comm)

    def keep(state: State, number: int, time: float, name: str) -> None:
        if output.field_files:
            series.add(state, time, name)
        if "csv" in output.files:
            table.add(state, name, time)
            if file.scene.contacts:
                write_contact_table(state, file.folder / "contact" / f"step_{number:04d}.csv")

    return keep


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
