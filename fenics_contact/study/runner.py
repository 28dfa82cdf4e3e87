"""Measurements in separate processes: repeated, stored when finished, resumed where they stopped."""

from __future__ import annotations

import hashlib
import json
import logging
import os
import statistics
import sys
import tempfile
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass, field, fields, replace
from pathlib import Path
from time import perf_counter
from typing import Any, TextIO

from fenics_contact._base.checks import naming_arguments
from fenics_contact._base.launching import FinishedProcess, finished, last_words, launcher, sharing_launcher
from fenics_contact._base.progress import Task, duration, show_progress
from fenics_contact.output.files import write_json
from fenics_contact.output.result import versions
from fenics_contact.study.results import Results, Run
from fenics_contact.study.scenes import find_study, scene_file
from fenics_contact.study.study import Parameters, StudyScene, Sweep

#: The program of a run: the program, not the package, chooses the communicator.
PROGRAM = "from mpi4py import MPI; from fenics_contact.study.worker import main; main(MPI.COMM_WORLD)"
WITHOUT_MPI = "from fenics_contact.study.worker import main; main(None)"
#: Failures that may be transient.
TRANSIENT = {"crash", "timeout"}

Record = dict[str, Any]
logger = logging.getLogger(__name__)


@dataclass(frozen=True)
class Job:
    """A measurement.

    `function`: function called on all ranks, ``"module:function"``, with the communicator and the arguments.
    It returns a mapping that JSON can hold, the same on every rank. `first`: additional ones for the first
    measurement only; `ranks`: MPI ranks; 0: one process without MPI, whose function receives None for the
    communicator; `threads`: BLAS threads of each rank; None: one, unless the environment sets another number;
    `short`: duration, [s], from which it is measured only once, as disturbances matter little.
    """

    name: str
    function: str
    arguments: Mapping[str, Any] = field(default_factory=dict)
    first: Mapping[str, Any] = field(default_factory=dict)
    ranks: int = 1
    threads: int | None = None
    repeats: int = 1
    short: float = float("inf")
    limit: float = 600.0
    weight: float = 1.0


def measure(job: Job, *, first: bool = True) -> Record:
    """Measure once; `first`: whether to use the arguments of the first measurement.

    Returns the result of the function, with ranks, ``peak_memory`` and ``import_memory`` of all ranks
    together, [byte], and the machine's ``load_average`` over the minute before; or ``failed`` with ``kind``
    and ``message``.
    """
    load = os.getloadavg()[0]
    with tempfile.TemporaryDirectory() as folder:
        file = Path(folder) / "record.json"
        arguments = {**job.arguments, **(job.first if first else {})}
        words = json.dumps({"function": job.function, "arguments": arguments, "file": str(file)})
        program = PROGRAM if job.ranks else WITHOUT_MPI
        command = [*sharing_launcher(max(1, job.ranks)), sys.executable, "-c", program, words]
        environment = _environment(job.threads)
        ending = finished(command, job.limit, environment=environment)
        record = _read(file)
        if not record and (ending.status or 0) > 0 and not ending.output + ending.errors:
            # The start of MPI itself ends so, rarely; what a run raises is always printed. A signal, as for
            # want of memory, has a negative status and would end the run again.
            logger.warning("%s exited with status %d and printed nothing: once more", job.name, ending.status)
            ending = finished(command, job.limit, environment=environment)
            record = _read(file)
    if not record:
        record = {"failed": _failure(command, ending, job.limit)}
    return {**record, "load_average": load}


def _environment(threads: int | None) -> dict[str, str]:
    """Return the environment of a run: this package, with ranks instead of threads on the cores."""
    environment = {"OPENBLAS_NUM_THREADS": "1", "OMP_NUM_THREADS": "1", **os.environ}
    if threads is not None:
        environment["OPENBLAS_NUM_THREADS"] = str(threads)
    package = str(Path(__file__).resolve().parents[2])
    return environment | {
        "PYTHONPATH": os.pathsep.join(filter(None, [package, environment.get("PYTHONPATH", "")]))
    }


def _read(file: Path) -> Record:
    """Return the record of a file, an empty one if it is missing or holds none."""
    try:
        record = json.loads(file.read_text(encoding="utf-8"))
    except (OSError, ValueError):
        return {}
    return record if isinstance(record, dict) else {}


def _failure(command: list[str], ending: FinishedProcess, limit: float) -> dict[str, str]:
    if ending.status is None:
        return {"kind": "timeout", "message": f"it did not end within {limit:g} s and was ended"}
    words = last_words(command, ending.output + ending.errors)
    return {"kind": "crash", "message": f"it ended with exit status {ending.status}: {words}"}


def fingerprint(files: Iterable[Path]) -> str:
    """Return a short hash of the code that runs execute: measurements of other code are not used."""
    digest = hashlib.sha256()
    for path in sorted(files):
        digest.update(path.name.encode() + b"\0" + path.read_bytes())
    return digest.hexdigest()[:12]


@dataclass(frozen=True)
class Store:
    """Finished measurements on disk, one file each, with the mark of the code, see `fingerprint`."""

    folder: Path
    mark: str

    def file(self, job: Job, repeat: int) -> Path:
        """Return the file of a measurement."""
        what = [job.name, job.function, job.arguments, job.ranks, job.threads, self.mark]
        key = json.dumps(what, sort_keys=True).encode()
        return self.folder / f"{hashlib.sha256(key).hexdigest()[:16]}-{repeat}.json"

    def read(self, job: Job, repeat: int) -> Record:
        """Return a measurement or its failure, an empty record if it is missing or damaged (logged)."""
        path = self.file(job, repeat)
        if not path.exists():
            return {}
        record = _read(path)
        if "load_average" not in record:
            logger.warning("%s holds no record of a run: it is done again", path)
            return {}
        return record

    def records(self, job: Job) -> list[Record]:
        """Return all measurements of a job, the first one first; empty if that is missing."""
        records = [self.read(job, repeat) for repeat in range(job.repeats)]
        return [record for record in records if record] if records[0] else []

    def complete(self, job: Job) -> bool:
        """Return whether a job has all its measurements, without a failure."""
        missing = any(self.missing(job, repeat) for repeat in range(job.repeats))
        return not missing and not any("failed" in record for record in self.records(job))

    def forget(self, job: Job) -> None:
        """Remove all measurements of a job."""
        for repeat in range(job.repeats):
            self.file(job, repeat).unlink(missing_ok=True)

    def missing(self, job: Job, repeat: int) -> bool:
        """Return whether a measurement is missing and needed, or failed in a way that may be transient."""
        record = self.read(job, repeat)
        if record:
            return "failed" in record and record["failed"]["kind"] in TRANSIENT
        first = self.read(job, 0) if repeat else {}
        return not repeat or (bool(first) and "failed" not in first and first.get("seconds", 0.0) < job.short)

    def write(self, job: Job, repeat: int, record: Record) -> None:
        """Store a measurement; the file is written atomically."""
        what = {"name": job.name, "arguments": dict(job.arguments), "code": self.mark}
        write_json(self.file(job, repeat), {**what, **record})


def measure_all(
    jobs: Sequence[Job],
    store: Store,
    *,
    title: str,
    warm_up: Sequence[Job] = (),
    stream: TextIO | None = None,
) -> None:
    """Measure and store what is missing.

    A job is repeated only after all others were measured, so that a temporary load does not affect one job
    only.
    """
    launcher(max(job.ranks for job in jobs) or 1)  # raises if the ranks cannot be started
    for repeat in range(max(job.repeats for job in jobs)):
        wanted = [job for job in jobs if repeat < job.repeats and store.missing(job, repeat)]
        for job in warm_up if wanted and not repeat else ():
            logger.info("warm-up: %s", job.name)
            measure(job)
        words = title if repeat == 0 else f"{title}, repeat {repeat + 1}"
        with show_progress(stream=stream):
            _measure_each(wanted, store, repeat, words)


def _measure_each(jobs: Sequence[Job], store: Store, repeat: int, title: str) -> None:
    """Measure some jobs once each; the remaining time follows from their weights."""
    weights, elapsed = [job.weight for job in jobs], 0.0
    with Task(title, unit="runs", total=len(jobs)) as task:
        for number, job in enumerate(jobs, 1):
            task.step(number - 1, words=job.name)
            start = perf_counter()
            record = measure(job, first=repeat == 0)
            store.write(job, repeat, record)
            elapsed += perf_counter() - start
            left = elapsed * sum(weights[number:]) / sum(weights[:number])
            rest = f", {duration(left)} left" if number < len(jobs) else ""
            task.step(number)
            logger.info("%d/%d %s: %s%s", number, len(jobs), job.name, _outcome(record), rest)


def _outcome(record: Record) -> str:
    if "failed" in record:
        return f"failed: {record['failed']['message']}"
    return f"{record['seconds']:.2f} s" if "seconds" in record else "done"


def summarised(name: str, records: Sequence[Record]) -> Record:
    """Return one record for all measurements of a job.

    Seconds, memory and load become medians, also by phase; everything else is from the first one.
    """
    first = records[0]
    for key in ("counts", "refused"):
        for record in records[1:]:
            if key in record and record[key] != first.get(key):
                raise ValueError(
                    f"{key} of {name} must be equal in all repetitions, got {first.get(key)}, {record[key]}"
                )
    result = dict(first)
    for key, value in first.items():
        known = [record[key] for record in records if record.get(key) is not None]
        if key.startswith("phases"):
            result[key] = {name: statistics.median(each.get(name, 0.0) for each in known) for name in value}
        elif known and (key == "ratio" or key.endswith(("seconds", "memory", "load_average"))):
            result[key] = statistics.median(known)
    return result | {"repeats": len(records)}


#: A run longer than this, [s], is measured once.
SHORT = 10.0
_PACKAGE = Path(__file__).resolve().parents[1]
#: Modules of this part that affect the numbers of a run.
_MEASURING = ("measuring.py", "study.py", "worker.py")


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


@naming_arguments
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
    """A study that can be measured; one setting at a time is varied around `base`."""

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
    """Plan a study; arguments as for `run_study`."""
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
    rooms = [room for room in _PACKAGE.iterdir() if room.is_dir() and room.name not in ("study", "pictures")]
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
