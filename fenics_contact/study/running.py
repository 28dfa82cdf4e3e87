"""Run a study: every set of parameters that is not measured yet, each in its own process."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, fields, replace
from pathlib import Path
from typing import TextIO

from fenics_contact.io import versions
from fenics_contact.study.parameters import Parameters, Sweep
from fenics_contact.study.protocol import StudyScene
from fenics_contact.study.results import Results, Run
from fenics_contact.study.runner import Job, Record, Store, fingerprint, measure_all, summarised
from fenics_contact.study.scenes import find_study, scene_file

#: A run longer than this, [s], is measured once.
SHORT = 10.0
_PACKAGE = Path(__file__).resolve().parents[1]
#: Modules of this part that affect the numbers of a run.
_MEASURING = {"measuring.py", "parameters.py", "solving.py", "true_error.py", "worker.py"}


@dataclass(frozen=True)
class Settings:
    """How a study is measured.

    Attributes:
        ranks: MPI ranks of every run.
        repeats: Number of measurements of a run of less than 10 s; the median counts.
        limit: Seconds after which a run is aborted.
        verify: Compare with the exact discrete solution, and measure the parts of the error.
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
    """Measure all missing runs of a study.

    Every run has its own process, so that its memory is separate and a failure affects no other run; failures
    are recorded with their reason. Finished runs are stored and reused while the code and the settings stay
    the same.

    Args:
        scene: Name of a built-in study or a Python file, see `find_study`.
        runs: Folder for the runs, one file each; created.
        sweep: The runs; the scene's own by default.
        settings: Ranks, repeats, limits.
        stream: Stream for progress; stderr by default.

    Returns:
        The measurements.

    Raises:
        InvalidInputError: If the scene is unknown.
        MissingRequirementError: If several ranks are requested and there is no mpirun.
    """
    plan = prepare(scene, runs, sweep=sweep, settings=settings)
    plan.measure(stream)
    return plan.collected()


@dataclass(frozen=True)
class StudyPlan:
    """A study that can be measured.

    Attributes:
        study: The scene.
        base: Settings around which one at a time is varied.
        jobs: All runs, coarse ones first.
        store: Store of the measurements, marked with the code at the start.
        ranks: MPI ranks of every run.
    """

    study: StudyScene
    base: Parameters
    jobs: Mapping[Parameters, Job]
    store: Store
    ranks: int

    def measure(self, stream: TextIO | None = None) -> None:
        """Measure what is missing; progress is reported on a stream, stderr by default."""
        jobs, title = tuple(self.jobs.values()), self.study.title
        measure_all(jobs, self.store, title=title, warm_up=self._warm_up(), stream=stream)

    def collected(self) -> Results:
        """Return the measurements so far."""
        measured = {parameters: self.store.records(job) for parameters, job in self.jobs.items()}
        runs = tuple(_joined(parameters, records) for parameters, records in measured.items() if records)
        what = {**versions(), "code": self.store.mark}
        return Results(self.study.facts, self.ranks, runs, self.base, what)

    def _warm_up(self) -> Sequence[Job]:
        """Return one run of each missing kind, on the smallest mesh."""
        smallest = min(parameters.size for parameters in self.jobs)
        kinds = {
            (parameters.cell, parameters.balanced): replace(
                job, arguments=_arguments(job, replace(parameters, size=smallest, subdomains=None))
            )
            for parameters, job in self.jobs.items()
            if self.store.missing(job, 0)
        }
        return tuple(kinds.values())


def prepare(
    scene: str, runs: str | Path, *, sweep: Sweep | None = None, settings: Settings | None = None
) -> StudyPlan:
    """Plan a study; arguments as for `run_study`.

    Raises:
        InvalidInputError: If the scene is unknown.
    """
    study, settings = find_study(scene), settings or Settings()
    chosen = sweep or study.sweep
    common = Job(
        "", f"{__package__}.measuring:measured", {"scene": scene}, {"verify": settings.verify},
        ranks=settings.ranks, repeats=settings.repeats, short=SHORT, limit=settings.limit,
    )  # fmt: skip
    jobs = {
        run: replace(common, name=str(run), arguments=_arguments(common, run), weight=float(run.size**2))
        for run in chosen.runs()
    }
    return StudyPlan(study, chosen.base, jobs, Store(Path(runs), fingerprint(_code(scene))), settings.ranks)


def _arguments(job: Job, parameters: Parameters) -> dict[str, object]:
    return {**job.arguments, "parameters": parameters.as_dict()}


def _code(scene: str) -> list[Path]:
    """Return the files that a run executes: plotting does not affect its numbers."""
    rooms = [room for room in _PACKAGE.iterdir() if room.is_dir() and room.name not in ("study", "viz")]
    executed = [path for room in rooms for path in room.rglob("*.py")]
    executed += [_PACKAGE / "study" / name for name in _MEASURING]
    return [*executed, scene_file(scene) or _PACKAGE / "study" / "scenes" / f"{scene}.py"]


def _joined(parameters: Parameters, records: Sequence[Record]) -> Run:
    """Return the run that combines all its measurements."""
    if "failed" in records[0]:
        failed = records[0]["failed"]
        return Run(parameters, failed=f"{failed['kind']}: {failed['message']}")
    good = [record for record in records if "failed" not in record]
    seconds = [record["seconds"] for record in good]
    one = summarised(str(parameters), good) | {"parameters": parameters}
    one["spread"] = (min(seconds), max(seconds))
    one["memory"] = max(record["memory"] or 0 for record in good) or None
    one["load_average"] = max(record["load_average"] for record in good)
    return Run(**{each.name: one[each.name] for each in fields(Run) if each.name in one})
