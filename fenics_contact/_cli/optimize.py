"""`fenics-contact optimize`: the shape optimisation of a scene file, and the files of the design."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from pathlib import Path

import numpy as np
import typer

from fenics_contact._base.display import DerivedUnits
from fenics_contact._cli.console import Console, ExitCode, facts
from fenics_contact._cli.options import checkpoint_of, forget, plan_of_design, resumable, scene_command
from fenics_contact._cli.run import table_of_levels
from fenics_contact._cli.view import Gallery, can_draw, draw_meshes, draw_state
from fenics_contact._optimize.result import Result
from fenics_contact._scene.scene import Scene
from fenics_contact._scene_file.reading import SceneFile, ShapeTask
from fenics_contact.design.memory import DesignPoint, JointPoint
from fenics_contact.design.problem import ShapeProblem
from fenics_contact.design.several import LoadPath
from fenics_contact.errors import InvalidInputError
from fenics_contact.output.cad import CadError, write_step
from fenics_contact.output.files import only_run_in
from fenics_contact.output.paraview import ResultSeries, file_of_each, write_vtu
from fenics_contact.output.result import write_optimisation_result
from fenics_contact.output.surfaces import write_design_table, write_stl
from fenics_contact.output.tables import write_contact_table
from fenics_contact.results.contact import pairs_in_words

_MILLIMETRES = {"µm": 1e-3, "um": 1e-3, "mm": 1.0, "cm": 10.0, "m": 1000.0, "in": 25.4}


def check_design_files(file: SceneFile) -> None:
    """Refuse a file without a design, and kinds of files that the scene cannot have, before solving."""
    file.require_design()
    kinds, length = file.document.output.design, file.document.units.length
    if "stl" in kinds and file.scene.dim == 2:
        raise InvalidInputError('output.design must be "csv" or "step" for a plane scene, got "stl"')
    if "step" in kinds and length not in _MILLIMETRES:
        raise InvalidInputError(
            f'output.design "step" needs a unit of length that is known in millimetres, got {length!r}: name '
            f"one of {', '.join(_MILLIMETRES)} in [units]"
        )


def write_design_files(
    console: Console,
    file: SceneFile,
    problem: ShapeProblem | LoadPath,
    alpha: np.ndarray,
    fine: ShapeProblem | LoadPath | None = None,
) -> list[Path]:
    """Write the files of a design that the scene file asks for, and return them. Collective.

    Surfaces of `problem` have grids of nodes; `fine` is on the mesh whose triangles are written.
    """
    kinds, length, folder = file.document.output.design, file.document.units.length, file.folder
    bodies = sorted({design.body for design in problem.designs})
    written = []
    if "csv" in kinds:
        for number in range(len(problem.designs)):
            path = folder / ("design.csv" if number == 0 else f"design_{number + 1}.csv")
            written.append(write_design_table(problem, alpha, path, design=number, length=length))
    if "stl" in kinds:
        for body, path in file_of_each(bodies, folder, "design", ".stl").items():
            written.append(write_stl(fine or problem, alpha, path, body=body))
    if "step" in kinds:
        for body, path in file_of_each(bodies, folder, "design", ".step").items():
            _write_step(console, problem, alpha, path, body, _MILLIMETRES[length])
            written.append(path)
    return written


def _write_step(
    console: Console, problem: ShapeProblem | LoadPath, alpha: np.ndarray, path: Path, body: str, scale: float
) -> None:
    """Write a body, or what can be written of it. Collective."""
    try:
        write_step(problem, alpha, path, body=body, scale=scale)
    except CadError as error:
        console.write(f"{path.name} has the designed surface alone: {error}")
        write_step(problem, alpha, path, body=body, scale=scale, solid=False)


def add_to(app: typer.Typer) -> None:
    """Add the command to the program."""
    app.command("optimize", short_help="optimise the contact shape of a scene file")(optimize)


def _check(file: SceneFile) -> None:
    check_design_files(file)
    file.check_refined()


@dataclass(frozen=True, eq=False)
class _Done:
    """An optimisation that ended.

    `problem`: that of the result, on the last mesh; `gridded`: on a mesh whose designed surfaces have grids
    of nodes, in space the first; `before`: the first design, on the same mesh; `products`: products with F on
    all meshes; `optimisations`: one for each mesh; `meshes`: scenes whose meshes are drawn; `missed`: why an
    accuracy was not reached.
    """

    result: Result
    problem: ShapeProblem | LoadPath
    gridded: ShapeProblem | LoadPath
    before: DesignPoint | JointPoint
    products: int
    written: list[Path]
    optimisations: Sequence[Result]
    meshes: Mapping[str, Scene] = field(default_factory=dict)
    missed: str = ""


def _optimize(console: Console, file: SceneFile, resume: bool | None, pictures: bool) -> None:
    """Optimise the contact shape described by the [design] of a scene file."""
    task = file.shape_task()
    words = file.document.design.objective_in_words  # type: ignore[union-attr]
    console.write(f"{task.problem.size} design variables, objective {words}")
    refines = file.document.accuracy is not None
    with only_run_in(file.folder, console.comm):
        done = (_to_accuracy if refines else _minimised)(console, file, task, resume)
        console.write(facts(_facts(file, task, done)))
        gallery = Gallery()
        if pictures and can_draw(console, file, gallery):
            _draw(console, file, done, gallery)
    names = ", ".join(["result.json", *(path.name for path in (*done.written, *gallery.drawn))])
    console.write(f"results in {file.folder}/: {names}")
    if done.missed:
        console.write(f"the accuracy was not reached: {done.missed}")
        raise typer.Exit(int(ExitCode.NOT_CONVERGED))
    if not done.result.reason.success:
        console.write(f"not converged: {done.result.reason.value}")
        raise typer.Exit(int(ExitCode.NOT_CONVERGED))
    gallery.require_all()


optimize = scene_command(_optimize, plan=plan_of_design, check=_check, accurate=("accuracy",))


def _to_accuracy(console: Console, file: SceneFile, task: ShapeTask, resume: bool | None) -> _Done:
    """Run the optimisation on finer and finer meshes and write its files. Collective."""
    asked = file.document.accuracy
    assert asked is not None
    if resume:
        raise InvalidInputError("--resume needs a checkpoint, and an optimisation to an accuracy keeps none")
    found = task.minimize_to(asked.relative_error, asked.made(), table_of_levels(console))
    console.write(f"{found.reason}\n")
    last, result = found.problems[-1], found.optimisations[-1]
    gridded = last if file.scene.dim == 2 else found.problems[0]
    more = {"scene_file": file.source.name, "title": file.title}
    write_optimisation_result(result, last, file.folder, more=more, accuracy=found)
    kinds, written = file.document.output.files, list[Path]()
    if "vtu" in kinds:
        written.append(write_vtu(found.state, file.folder))
    written += write_design_files(console, file, gridded, found.x, last)
    if "csv" in kinds and file.scene.contacts:
        written.append(write_contact_table(found.state, file.folder / "contact.csv"))
    products = sum(level.products for level in found.levels)
    return _Done(
        result, last, gridded, last.at(task.start), products, written, found.optimisations,
        {"first": file.scene, "last": found.state.scene}, "" if found.reached else found.reason,
    )  # fmt: skip


def _minimised(console: Console, file: SceneFile, task: ShapeTask, resume: bool | None) -> _Done:
    """Run the optimisation and write its files. Collective."""
    checkpoint = checkpoint_of(file, resume)
    kinds = file.document.output.field_files
    series = ResultSeries(file.folder, "designs", console.comm, formats=kinds) if kinds else None
    follow = None if series is None else series.follow(task.problem)
    with resumable(console, checkpoint):
        result = task.minimize(callback=follow, checkpoint=checkpoint)
    more = {"scene_file": file.source.name, "title": file.title}
    write_optimisation_result(result, task.problem, file.folder, more=more)
    written = [] if series is None else [series.path]
    written += write_design_files(console, file, task.problem, result.x)
    if "csv" in file.document.output.files and file.scene.contacts:
        written.append(write_contact_table(task.problem.at(result.x).state, file.folder / "contact.csv"))
    # A run that stopped at a limit can continue from its checkpoint with a larger one.
    if result.reason.success:
        forget(console, checkpoint)
    assert task.problem.first is not None
    first, products = task.problem.first, task.problem.products
    return _Done(result, task.problem, task.problem, first, products, written, (result,))


def _facts(file: SceneFile, task: ShapeTask, done: _Done) -> dict[str, str]:
    problem, result = done.problem, done.result
    before, after, units = done.before, problem.at(result.x), file.document.units
    every = done.optimisations
    evaluations = sum(each.evaluations for each in every)
    drop = (before.value - after.value) / abs(before.value) * 100 if before.value else 0.0
    rows = {
        "objective before": f"{before.value:.9g}",
        "objective after": f"{after.value:.9g}",
        "drop": f"{drop:.3f} %",
        "iterations": f"{sum(each.iterations for each in every)}, {evaluations} evaluations",
        "work": f"{done.products} products with F",
        "stopped because": result.reason.value,
    }
    for one in result.constraints:
        rows[f"constraint {one.name}"] = f"{one.value:.6g}{', active' if one.active else ''}"
    for name, point in (("before", before), ("after", after)):
        state = point.state
        force = DerivedUnits.of(units.force, units.length, state.scene.dimension_record).force
        pairs = pairs_in_words(state.scene, state.contact, force, units.stress, units.length)
        for number, words in enumerate(pairs):
            rows[f"contact {number} {name}"] = words
    volume, start = problem.volume(result.x)[0], problem.volume(task.start)[0]
    rows["volume"] = f"{volume / start:.6f} of that at the start"
    rows["seconds"] = ", ".join(f"{name} {spent:.2f}" for name, spent in problem.seconds.items())
    return rows


def _draw(console: Console, file: SceneFile, done: _Done, gallery: Gallery) -> None:
    """Draw the states before and after, the control net and the history. Collective."""
    from fenics_contact.pictures.designs import plot_control_net, plot_convergence

    result, net = done.result, done.gridded
    for name, point in (("before", done.before), ("after", done.problem.at(result.x))):
        draw_state(console, file, {name: point.state}, gallery, f"_{name}")
    for number in range(len(net.designs)):
        path = file.folder / ("control_net.png" if number == 0 else f"control_net_{number + 1}.png")
        plot_control_net(net, result.x, path, design=number)
        gallery.drawn.append(path)
    if done.meshes:
        draw_meshes(file, done.meshes, gallery)
        return
    path = file.folder / "convergence.png"
    plot_convergence(result.history, path, title=file.title, comm=console.comm)
    gallery.drawn.append(path)
