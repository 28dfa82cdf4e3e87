"""Run a study: every run that is not there yet, repeated, kept as soon as it is done."""

from __future__ import annotations

import logging
import statistics
from collections.abc import Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from time import perf_counter
from typing import Any, TextIO

from fenics_contact.io import versions
from fenics_contact.launching import launcher
from fenics_contact.progress import show_progress
from fenics_contact.study.launching import Record, Task, measure
from fenics_contact.study.parameters import Parameters, Sweep
from fenics_contact.study.progress import Progress, described
from fenics_contact.study.protocol import StudyScene
from fenics_contact.study.results import Results, Run
from fenics_contact.study.scenes import find_study
from fenics_contact.study.store import Store, fingerprint

#: A run that takes longer is measured once: what disturbs short ones matters little to it.
SHORT = 10.0

logger = logging.getLogger(__name__)


@dataclass(frozen=True)
class Settings:
    """How a study is measured.

    Attributes:
        ranks: MPI ranks of every run.
        repeats: How often a run of less than 10 s is measured; the median counts.
        limit: Seconds after which a run is given up.
        verify: Compare with the exact solution of the same mesh, and measure the errors' parts.
    """

    ranks: int = 1
    repeats: int = 3
    limit: float = 600.0
    verify: bool = True


def run_study(
    scene: str,
    runs: str | Path,
    *,
    sweep: Sweep | None = None,
    settings: Settings | None = None,
    stream: TextIO | None = None,
) -> Results:
    """Measure all runs of a study that are not there yet.

    Every run has a process of its own, so that its memory is its own and a failure ends nothing but itself;
    what failed is recorded with its reason. Finished runs are kept and used again while the code and the
    settings stay the same.

    Args:
        scene: Name of a built-in study or a Python file, see `find_study`.
        runs: Folder in which runs are kept, one file each; created.
        sweep: Which runs; the scene's own by default.
        settings: Ranks, repeats, limits.
        stream: Where progress is told; stderr by default.

    Returns:
        What was measured.

    Raises:
        InvalidInputError: If the scene is unknown.
        MissingRequirementError: If several ranks are asked for and there is no mpirun.
    """
    plan = prepare(scene, runs, sweep=sweep, settings=settings)
    measure_all(plan, stream)
    return collected(plan)


@dataclass(frozen=True)
class StudyPlan:
    """A study that can be measured.

    Attributes:
        study: The scene.
        base: Settings around which one at a time is varied.
        tasks: All runs, coarse ones first.
        store: Where measurements are kept, marked with the code as it was at the start.
        settings: Ranks, repeats, limits.
    """

    study: StudyScene
    base: Parameters
    tasks: tuple[Task, ...]
    store: Store
    settings: Settings


def prepare(
    scene: str, runs: str | Path, *, sweep: Sweep | None = None, settings: Settings | None = None
) -> StudyPlan:
    """Plan a study; arguments as for `run_study`.

    Raises:
        InvalidInputError: If the scene is unknown.
    """
    study, settings = find_study(scene), settings or Settings()
    chosen = sweep or study.sweep
    tasks = [Task(scene, run, settings.ranks, settings.verify, settings.limit) for run in chosen.runs()]
    store = Store(Path(runs), fingerprint(scene))
    return StudyPlan(study, chosen.base, tuple(tasks), store, settings)


def collected(plan: StudyPlan) -> Results:
    """Return what has been measured of a study so far."""
    found = [(task, _repeats(task, plan.store, plan.settings.repeats)) for task in plan.tasks]
    runs = tuple(_joined(task.parameters, repeats) for task, repeats in found if repeats)
    what = {**versions(), "code": plan.store.mark}
    return Results(plan.study.facts, plan.settings.ranks, runs, plan.base, what)


def _repeats(task: Task, store: Store, most: int) -> list[Record]:
    """Return the measurements of a run, also a failure that may not happen again."""
    found = [store.read(task, repeat, transient=repeat == 0) for repeat in range(most)]
    return [record for record in found if record is not None] if found[0] is not None else []


def measure_all(plan: StudyPlan, stream: TextIO | None = None) -> None:
    """Measure what is missing.

    Args:
        plan: The study.
        stream: Where progress is told; stderr by default.
    """
    launcher(plan.settings.ranks)  # refuses ranks that cannot be started
    # A run is repeated only after all others were measured: load that lasts a while hits no run alone.
    for repeat in range(plan.settings.repeats):
        wanted = [task for task in plan.tasks if _wanted(task, plan.store, repeat)]
        if not wanted:
            continue
        if repeat == 0:
            _warm_up(wanted, min(task.parameters.size for task in plan.tasks))
        title = plan.study.title
        words = title if repeat == 0 else f"{title}, repeat {repeat + 1}"
        with show_progress(stream=stream), Progress([task.parameters for task in wanted], words) as progress:
            for task in wanted:
                progress.begin(task.parameters)
                _measure(task, plan.store, repeat, progress)


def _measure(task: Task, store: Store, repeat: int, progress: Progress) -> None:
    start = perf_counter()
    record = measure(replace(task, verify=task.verify and repeat == 0))
    store.write(task, repeat, record)
    failed = record.get("failed")
    words = f"failed: {failed['message']}" if failed else f"{record['seconds']:.2f} s"
    progress.done(task.parameters, perf_counter() - start, words)


def _wanted(task: Task, store: Store, repeat: int) -> bool:
    """Tell whether a measurement is missing and makes sense."""
    if store.read(task, repeat) is not None:
        return False
    if repeat == 0:
        return True
    first = store.read(task, 0)
    return first is not None and "failed" not in first and first["seconds"] < SHORT


def _warm_up(tasks: Sequence[Task], size: int) -> None:
    """Compile the forms of all kinds of runs on the smallest mesh: measured runs find them on the disk."""
    smallest = {
        (task.parameters.cell, task.parameters.balanced): replace(
            task, parameters=replace(task.parameters, size=size, subdomains=None)
        )
        for task in tasks
    }
    for task in smallest.values():
        logger.info("warm-up: %s", described(task.parameters))
        measure(task)


def _joined(parameters: Parameters, repeats: Sequence[Record]) -> Run:
    """Return what is known of a run from all its measurements."""
    first = repeats[0]
    if "failed" in first:
        return Run(parameters, failed=f"{first['failed']['kind']}: {first['failed']['message']}")
    good = [record for record in repeats if "failed" not in record]
    middle = sorted(good, key=lambda record: float(record["seconds"]))[(len(good) - 1) // 2]
    known: dict[str, Any] = {
        name: first.get(name) for name in ("counts", "residual", "quantities", "parts", "true_errors")
    }
    memory = [record["memory"] for record in good if record["memory"]]
    return Run(
        parameters,
        seconds=float(statistics.median(record["seconds"] for record in good)),
        spread=(min(record["seconds"] for record in good), max(record["seconds"] for record in good)),
        repeats=len(good),
        phases=middle["phases"],
        phases_after=middle["phases_after"],
        memory=max(memory) if memory else None,
        load_average=max(record["load_average"] for record in good),
        **known,
    )
