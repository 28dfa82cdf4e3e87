"""The command line of studies: `python -m fenics_contact accuracy SCENE`."""

from __future__ import annotations

import argparse
import signal
import sys
from dataclasses import replace
from pathlib import Path
from typing import Any

from fenics_contact.errors import FenicsContactError, InvalidInputError
from fenics_contact.study.overview import write_overview
from fenics_contact.study.parameters import BALANCED, DISCRETISATIONS, Sweep, Tolerance
from fenics_contact.study.report import write_report
from fenics_contact.study.running import Settings, StudyPlan, collected, measure_all, prepare
from fenics_contact.study.scenes import BUILT_IN, find_study

ABOUT = """\
Measure what accuracy costs in time. SCENE is one of {names}, or a Python file that defines
`study`, a fenics_contact.study.StudyScene. Results, table, figures and advice are written to a folder; what
was measured already is not measured again.
"""


def add_parser(commands: Any) -> None:
    """Add the command to those of a program."""
    parser = commands.add_parser(
        "accuracy",
        help="measure what accuracy costs in time",
        description=ABOUT.format(names=", ".join(BUILT_IN)),
    )
    parser.add_argument("scene", metavar="SCENE", help=f"{', '.join(BUILT_IN)}, or a file that ends in .py")
    parser.add_argument("--quick", action="store_true", help="about a minute: coarse meshes, one repeat")
    parser.add_argument("--output", type=Path, help="folder of the results (output/studies/NAME)")
    parser.add_argument("--runs", type=Path, help="folder in which runs are kept (OUTPUT/runs)")
    parser.add_argument("--ranks", type=_positive, default=1, help="MPI ranks of every run (1)")
    parser.add_argument("--repeats", type=_positive, help="measurements of runs under 10 s (3; quick: 1)")
    parser.add_argument("--limit", type=_seconds, default=600.0, help="seconds that a run may take (600)")
    parser.add_argument("--report", action="store_true", help="measure nothing, write the results again")
    parser.add_argument("--no-figures", action="store_true", help="write no pictures")
    parser.add_argument("--page", action="store_true", help="also write README.md of all studies beside it")
    chosen = parser.add_argument_group("what is varied; by default what the scene suggests")
    chosen.add_argument("--sizes", type=_positive, nargs="+", help="meshes, larger is finer")
    chosen.add_argument("--tolerances", type=_tolerance, nargs="+", help='numbers or "balanced"')
    chosen.add_argument("--cells", nargs="*", help="cell types beside the base's")
    chosen.add_argument("--discretisations", nargs="*", choices=DISCRETISATIONS, help="beside the base's")
    chosen.add_argument(
        "--fixed-points", type=float, nargs="*", help="tolerances of the fixed point of Coulomb"
    )
    chosen.add_argument("--subdomains", type=_positive, nargs="*", help="numbers of subdomains")
    parser.set_defaults(run=run)


def run(options: argparse.Namespace) -> int:
    """Do what the command line asks for; return the exit status."""
    try:
        study = find_study(options.scene)
        sweep = sweep_from(options, study.quick if options.quick else study.sweep)
        folder = options.output or Path("output") / "studies" / study.name
        settings = Settings(options.ranks, options.repeats or (1 if options.quick else 3), options.limit)
        plan = prepare(options.scene, options.runs or folder / "runs", sweep=sweep, settings=settings)
        status = 0 if options.report else _measure(plan)
        results = collected(plan)
        if not results.good:
            reasons = "".join(f"\n  {run.failed}" for run in results.runs[:3])
            raise InvalidInputError(
                f"a report needs runs that have an answer, {folder} has none of this code and these options: "
                f"run the study without --report, or mend what failed{reasons}"
            )
        words = write_report(folder, results, figures=not options.no_figures)
        if options.page:
            write_overview(folder.parent)
    except FenicsContactError as error:
        sys.stderr.write(f"error: {error}\n")
        return 2 if isinstance(error, InvalidInputError) else 1
    sys.stdout.write("\n".join([*words, f"results in {folder}/", ""]))
    return status


def _measure(plan: StudyPlan) -> int:
    """Measure; return 0, or the exit status of an interrupted program."""
    before = signal.signal(signal.SIGTERM, lambda *_: sys.exit(143))  # so that the running process ends, too
    try:
        measure_all(plan)
    except (KeyboardInterrupt, SystemExit) as stop:
        sys.stderr.write("interrupted: what is done is kept, and the same command goes on from there\n")
        return 143 if isinstance(stop, SystemExit) else 130
    finally:
        signal.signal(signal.SIGTERM, before)
    return 0


def sweep_from(options: argparse.Namespace, sweep: Sweep) -> Sweep:
    """Return the runs that the options ask for, the scene's where they say nothing.

    Raises:
        InvalidInputError: If a cell type is unknown.
    """
    names = ("sizes", "tolerances", "cells", "discretisations", "fixed_points", "subdomains")
    given: dict[str, Any] = {
        name: tuple(value) for name in names if (value := getattr(options, name)) is not None
    }
    chosen = replace(sweep, **given)
    if options.sizes and sweep.base.size not in chosen.sizes:
        # The base is one of the meshes: around it one setting at a time is varied.
        chosen = replace(chosen, base=replace(sweep.base, size=chosen.sizes[(len(chosen.sizes) - 1) // 2]))
    chosen.runs()  # refuses what no scene knows
    return chosen


def _positive(text: str) -> int:
    if not text.isdecimal() or int(text) < 1:
        raise argparse.ArgumentTypeError(f"needs a positive integer, got {text!r}")
    return int(text)


def _seconds(text: str) -> float:
    try:
        value = float(text)
    except ValueError:
        value = 0.0
    if not value > 0.0:
        raise argparse.ArgumentTypeError(f"needs a positive number of seconds, got {text!r}")
    return value


def _tolerance(text: str) -> Tolerance:
    if text == BALANCED:
        return BALANCED
    try:
        value = float(text)
    except ValueError:
        value = 0.0
    if not 0.0 < value < 1.0:
        raise argparse.ArgumentTypeError(
            f'a tolerance is a number between 0 and 1, or "balanced", got {text!r}'
        )
    return value
