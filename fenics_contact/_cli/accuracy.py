"""`fenics-contact accuracy`: measure the cost of accuracy in time."""

from __future__ import annotations

import logging
from collections.abc import Mapping, Sequence
from contextlib import nullcontext, suppress
from dataclasses import replace
from pathlib import Path
from typing import Annotated, Any

import typer

from fenics_contact._cli.console import ExitCode, Terminated, console_of, write_stderr
from fenics_contact.errors import InvalidInputError
from fenics_contact.output.files import only_run_in
from fenics_contact.study.report import write_report
from fenics_contact.study.results import Results
from fenics_contact.study.runner import Settings, StudyPlan, prepare
from fenics_contact.study.scenes import BUILT_IN, find_study
from fenics_contact.study.study import Sweep

NAMES = ", ".join(BUILT_IN)
ABOUT = (
    f"Measure what accuracy costs in time. SCENE is one of {NAMES}, or a Python file that defines "
    "`study`, a fenics_contact.study.StudyScene. Results, tables and figures are written to a folder; "
    "what was measured already is not measured again. Runs have processes of their own: ask for ranks with "
    "--ranks. Options of the sweep are given once for each value: --sizes 2 --sizes 3."
)


def add_to(app: typer.Typer) -> None:
    """Add the command to the program."""
    app.command("accuracy", help=ABOUT, short_help="measure what accuracy costs in time")(accuracy)


def _tolerance(text: str) -> float | str:
    with suppress(ValueError):
        return float(text)
    return text


def _several(name: str, words: str, **more: Any) -> Any:
    return typer.Option(f"--{name}", help=words, show_default=False, **more)


def accuracy(
    context: typer.Context,
    scene: Annotated[
        str, typer.Argument(metavar="SCENE", help=f"{NAMES}, or a file that ends in .py", show_default=False)
    ],
    quick: Annotated[
        bool, typer.Option("--quick", help="About a minute: coarse meshes, one repeat.")
    ] = False,
    output: Annotated[
        Path | None, typer.Option("--output", help="Folder of the results (output/studies/NAME).")
    ] = None,
    runs: Annotated[
        Path | None, typer.Option("--runs", help="Folder in which runs are stored (OUTPUT/runs).")
    ] = None,
    ranks: Annotated[int, typer.Option("--ranks", min=1, help="MPI ranks of every run.")] = 1,
    repeats: Annotated[
        int | None,
        typer.Option("--repeats", min=1, help="Measurements of runs under 10 s (3; quick: 1)."),
    ] = None,
    limit: Annotated[
        float, typer.Option("--limit", min=1e-3, help="Largest number of seconds that a run may take.")
    ] = 600.0,
    report: Annotated[
        bool, typer.Option("--report", help="Measure nothing, write the results again.")
    ] = False,
    no_figures: Annotated[bool, typer.Option("--no-figures", help="Write no pictures.")] = False,
    sizes: Annotated[list[int] | None, _several("sizes", "Meshes, larger is finer.", min=1)] = None,
    tolerances: Annotated[
        list[Any] | None, _several("tolerances", 'Numbers or "balanced".', parser=_tolerance)
    ] = None,
    cells: Annotated[list[str] | None, _several("cells", "Cell types in addition to the base's.")] = None,
    discretisations: Annotated[
        list[str] | None, _several("discretisations", "In addition to the base's.")
    ] = None,
    fixed_points: Annotated[
        list[float] | None, _several("fixed-points", "Tolerances of the fixed point of Coulomb.")
    ] = None,
    subdomains: Annotated[list[int] | None, _several("subdomains", "Numbers of subdomains.", min=1)] = None,
) -> None:
    """Measure what accuracy costs in time."""
    console = console_of(context)
    if console.comm.size > 1:
        raise InvalidInputError(f"a study starts its own ranks: give --ranks {console.comm.size}, not mpirun")
    logging.getLogger("fenics_contact").setLevel(logging.INFO)
    study = find_study(scene)
    given = {
        "sizes": sizes, "tolerances": tolerances, "cells": cells, "discretisations": discretisations,
        "fixed_points": fixed_points, "subdomains": subdomains,
    }  # fmt: skip
    sweep = _sweep(given, study.quick if quick else study.sweep)
    folder = output or Path("output") / "studies" / study.name
    settings = Settings(ranks, repeats or (1 if quick else 3), limit)
    plan = prepare(scene, runs or folder / "runs", sweep=sweep, settings=settings)
    with nullcontext() if report else only_run_in(folder, console.comm):
        status = 0 if report else _measure(plan)
        if status and (folder / "study.json").exists():
            console.write(f"results of an earlier run stay in {folder}/: --report writes those that are done")
            raise typer.Exit(status)
        words = write_report(folder, _answered(plan, folder), figures=not no_figures)
    console.write(f"{words}\nresults in {folder}/")
    if status:
        raise typer.Exit(status)


def _answered(plan: StudyPlan, folder: Path) -> Results:
    results = plan.collected()
    if not results.good:
        reasons = "".join(f"\n  {run.failed}" for run in results.runs[:3])
        raise InvalidInputError(
            f"a report needs runs that have an answer, {folder} has none: run without --report{reasons}"
        )
    return results


def _measure(plan: StudyPlan) -> int:
    """Measure; return 0, or the exit code of an interrupted program."""
    try:
        plan.measure()
    except (KeyboardInterrupt, Terminated) as stop:
        write_stderr("interrupted: what is done is kept, and the same command goes on from there\n")
        return int(ExitCode.TERMINATED if isinstance(stop, Terminated) else ExitCode.INTERRUPTED)
    return 0


def _sweep(given: Mapping[str, Sequence[Any] | None], sweep: Sweep) -> Sweep:
    """Return the runs selected by the options, the scene's by default."""
    known: dict[str, Any] = {name: tuple(values) for name, values in given.items() if values}
    chosen = replace(sweep, **known)
    if known.get("sizes") and sweep.base.size not in chosen.sizes:
        # The base is one of the meshes: around it one setting at a time is varied.
        chosen = replace(chosen, base=replace(sweep.base, size=chosen.sizes[(len(chosen.sizes) - 1) // 2]))
    chosen.runs()  # refuses what no scene knows
    return chosen
