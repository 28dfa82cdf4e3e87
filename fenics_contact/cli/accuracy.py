"""`fenics-contact accuracy`: measure the cost of accuracy in time."""

from __future__ import annotations

import logging
from collections.abc import Mapping, Sequence
from contextlib import nullcontext
from dataclasses import replace
from pathlib import Path
from typing import Any

import typer
from typer.core import TyperCommand

from fenics_contact.cli import accuracy_options as options
from fenics_contact.cli.desk import desk_of
from fenics_contact.cli.endings import Terminated
from fenics_contact.cli.streams import complain
from fenics_contact.errors import InvalidInputError
from fenics_contact.io import only_run_in
from fenics_contact.study import (
    Settings,
    StudyPlan,
    Sweep,
    find_study,
    prepare,
    write_overview,
    write_report,
)

ABOUT = (
    f"Measure what accuracy costs in time. SCENE is one of {options.NAMES}, or a Python file that defines "
    "`study`, a fenics_contact.study.StudyScene. Results, tables and figures are written to a folder; "
    "what was measured already is not measured again. Runs have processes of their own: ask for ranks with "
    "--ranks."
)
#: Options that take any number of values: --sizes 2 3 4. Without a value the list is empty.
LISTS = ("--sizes", "--tolerances", "--cells", "--discretisations", "--fixed-points", "--subdomains")


class _Lists(TyperCommand):
    """A command with options that take any number of values."""

    def parse_args(self, ctx: Any, args: list[str]) -> list[str]:
        """Repeat such options for each of their values."""
        return super().parse_args(ctx, spread(args))


def spread(arguments: Sequence[str]) -> list[str]:
    """Return arguments with ``--sizes 2 3`` as ``--sizes 2 --sizes 3``."""
    repeated: list[str] = []
    option, pending = "", False
    for argument in arguments:
        if argument.startswith("-") and argument != "-":
            repeated += [option, options.NOTHING] if pending else []
            option, pending = (argument, True) if argument in LISTS else ("", False)
            repeated += [] if option else [argument]
        elif option:
            repeated += [option, argument]
            pending = False
        else:
            repeated.append(argument)
    return [*repeated, option, options.NOTHING] if pending else repeated


def add_to(app: typer.Typer) -> None:
    """Add the command to the program."""
    words = "measure what accuracy costs in time"
    app.command("accuracy", cls=_Lists, help=ABOUT, short_help=words)(accuracy)


def accuracy(
    context: typer.Context,
    scene: options.SceneArgument,
    quick: options.QuickOption = False,
    output: options.OutputOption = None,
    runs: options.RunsOption = None,
    ranks: options.RanksOption = "1",
    repeats: options.RepeatsOption = None,
    limit: options.LimitOption = "600",
    report: options.ReportOption = False,
    no_figures: options.NoFiguresOption = False,
    page: options.PageOption = False,
    sizes: options.SizesOption = None,
    tolerances: options.TolerancesOption = None,
    cells: options.CellsOption = None,
    discretisations: options.DiscretisationsOption = None,
    fixed_points: options.FixedPointsOption = None,
    subdomains: options.SubdomainsOption = None,
) -> None:
    """Measure what accuracy costs in time."""
    desk = desk_of(context)
    if desk.comm.size > 1:
        raise InvalidInputError(
            f"a study starts its own ranks, got mpirun with {desk.comm.size}: run it without mpirun and "
            f"give --ranks {desk.comm.size}"
        )
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
    with nullcontext() if report else only_run_in(folder, desk.comm):
        status = 0 if report else _measure(plan)
        if status and (folder / "study.json").exists():
            desk.say(f"results of an earlier run stay in {folder}/: --report writes those of what is done")
            raise typer.Exit(status)
        words = _report(plan, folder, figures=not no_figures)
    if page:
        write_overview(folder.parent)
    desk.say(f"{words}\nresults in {folder}/")
    if status:
        raise typer.Exit(status)


def _report(plan: StudyPlan, folder: Path, *, figures: bool) -> str:
    results = plan.collected()
    if not results.good:
        reasons = "".join(f"\n  {run.failed}" for run in results.runs[:3])
        raise InvalidInputError(
            f"a report needs runs that have an answer, {folder} has none of this code and these options: "
            f"run the study without --report, or mend what failed{reasons}"
        )
    return write_report(folder, results, figures=figures)


def _measure(plan: StudyPlan) -> int:
    """Measure; return 0, or the exit code of an interrupted program."""
    try:
        plan.measure()
    except (KeyboardInterrupt, Terminated) as stop:
        complain("interrupted: what is done is kept, and the same command goes on from there\n")
        return 143 if isinstance(stop, Terminated) else 130
    return 0


def _sweep(given: Mapping[str, Sequence[Any] | None], sweep: Sweep) -> Sweep:
    """Return the runs selected by the options, the scene's by default.

    Raises:
        InvalidInputError: If a cell type is unknown.
    """
    nothing = (None, options.NOTHING)  # option given without a value
    known: dict[str, Any] = {
        name: tuple(value for value in values if value not in nothing)
        for name, values in given.items()
        if values
    }
    chosen = replace(sweep, **known)
    if known.get("sizes") and sweep.base.size not in chosen.sizes:
        # The base is one of the meshes: around it one setting at a time is varied.
        chosen = replace(chosen, base=replace(sweep.base, size=chosen.sizes[(len(chosen.sizes) - 1) // 2]))
    chosen.runs()  # refuses what no scene knows
    return chosen
