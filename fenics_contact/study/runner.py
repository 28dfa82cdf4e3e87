"""Measurements in processes of their own: repeated, kept when they are done, taken up where they stopped."""

from __future__ import annotations

import hashlib
import json
import logging
import os
import statistics
import sys
import tempfile
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass, field
from pathlib import Path
from time import perf_counter
from typing import Any, TextIO

from fenics_contact.io import write_json
from fenics_contact.launching import Ending, finished, last_words, launcher
from fenics_contact.progress import Task, duration, show_progress

#: The program of a run: the communicator is for a program to choose, not for the package.
PROGRAM = "from mpi4py import MPI; from fenics_contact.study.worker import main; main(MPI.COMM_WORLD)"
WITHOUT_MPI = "from fenics_contact.study.worker import main; main(None)"
#: Failures that may not happen again.
TRANSIENT = {"crash", "timeout"}

Record = dict[str, Any]
logger = logging.getLogger(__name__)


@dataclass(frozen=True)
class Job:
    """Something that is measured.

    Attributes:
        name: How progress and tables call it.
        function: What is called on all ranks, ``"module:function"``: with the communicator and the arguments.
            It returns a mapping that JSON can hold, the same on every rank.
        arguments: Named arguments that JSON can hold.
        first: More of them, for the first measurement alone.
        ranks: MPI ranks; 0: one process without MPI, whose function gets None for the communicator.
        threads: BLAS threads of each rank; None: one, unless the environment says otherwise.
        repeats: How often it is measured.
        short: Seconds from which on it is measured only once: what disturbs short runs matters little to it.
        limit: Seconds after which it is given up.
        weight: About how long it takes beside others.
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
    """Measure once.

    Args:
        job: What.
        first: Whether with the arguments of the first measurement.

    Returns:
        What the function returned, with ranks, ``peak_memory`` and ``import_memory`` of all ranks together,
        [byte], and the machine's ``load_average`` over the minute before; or ``failed``, which says why there
        is no answer by ``kind`` and ``message``.
    """
    load = os.getloadavg()[0]
    with tempfile.TemporaryDirectory() as folder:
        file = Path(folder) / "record.json"
        arguments = {**job.arguments, **(job.first if first else {})}
        words = json.dumps({"function": job.function, "arguments": arguments, "file": str(file)})
        program = PROGRAM if job.ranks else WITHOUT_MPI
        command = [*launcher(max(1, job.ranks)), sys.executable, "-c", program, words]
        ending = finished(command, job.limit, environment=_environment(job.threads))
        record = _read(file)
    if not isinstance(record, dict):
        record = {"failed": _failure(command, ending, job.limit)}
    return {**record, "load_average": load}


def _environment(threads: int | None) -> dict[str, str]:
    """Return the environment of a run: this very package, and ranks, not threads, that share the cores."""
    kept = {"OPENBLAS_NUM_THREADS": "1", "OMP_NUM_THREADS": "1", **os.environ}
    if threads is not None:
        kept["OPENBLAS_NUM_THREADS"] = str(threads)
    package = str(Path(__file__).resolve().parents[2])
    return kept | {"PYTHONPATH": os.pathsep.join(filter(None, [package, kept.get("PYTHONPATH", "")]))}


def _read(file: Path) -> Any:
    try:
        return json.loads(file.read_text(encoding="utf-8"))
    except (OSError, ValueError):
        return None


def _failure(command: list[str], ending: Ending, limit: float) -> dict[str, str]:
    if ending.status is None:
        return {"kind": "timeout", "message": f"it did not end within {limit:g} s and was ended"}
    words = last_words(command, ending.output + ending.errors)
    return {"kind": "crash", "message": f"it ended with exit status {ending.status}: {words}"}


def fingerprint(files: Iterable[Path]) -> str:
    """Return a short hash of the code that runs execute: what other code has measured is not used."""
    digest = hashlib.sha256()
    for path in sorted(files):
        digest.update(path.name.encode() + b"\0" + path.read_bytes())
    return digest.hexdigest()[:12]


@dataclass(frozen=True)
class Store:
    """Finished measurements on the disk, one file each.

    Attributes:
        folder: Where the files are.
        mark: What the code that ran is called, see `fingerprint`.
    """

    folder: Path
    mark: str

    def file(self, job: Job, repeat: int) -> Path:
        """Return the file of a measurement."""
        what = [job.name, job.function, job.arguments, job.ranks, job.threads, self.mark]
        key = json.dumps(what, sort_keys=True).encode()
        return self.folder / f"{hashlib.sha256(key).hexdigest()[:16]}-{repeat}.json"

    def read(self, job: Job, repeat: int) -> Record | None:
        """Return a measurement or the failure that was met, None if it is not there or damaged (logged)."""
        path = self.file(job, repeat)
        if not path.exists():
            return None
        record = _read(path)
        if not isinstance(record, dict) or "load_average" not in record:
            logger.warning("%s holds no record of a run: it is done again", path)
            return None
        return record

    def records(self, job: Job) -> list[Record]:
        """Return all measurements of a job, the first one first; none where that is missing."""
        found = [self.read(job, repeat) for repeat in range(job.repeats)]
        return [record for record in found if record is not None] if found[0] is not None else []

    def complete(self, job: Job) -> bool:
        """Tell whether a job is measured as often as it should be, without a failure."""
        missing = any(self.missing(job, repeat) for repeat in range(job.repeats))
        return not missing and not any("failed" in record for record in self.records(job))

    def forget(self, job: Job) -> None:
        """Remove all measurements of a job."""
        for repeat in range(job.repeats):
            self.file(job, repeat).unlink(missing_ok=True)

    def missing(self, job: Job, repeat: int) -> bool:
        """Tell whether a measurement is not there and makes sense, or failed in a way that may pass."""
        record = self.read(job, repeat)
        if record is not None:
            return "failed" in record and record["failed"]["kind"] in TRANSIENT
        first = self.read(job, 0) if repeat else None
        return not repeat or (
            first is not None and "failed" not in first and first.get("seconds", 0.0) < job.short
        )

    def write(self, job: Job, repeat: int, record: Record) -> None:
        """Keep a measurement; the file appears whole or not at all."""
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
    """Measure what is missing, and keep it.

    A job is repeated only after all others were measured: load that lasts a while hits none alone.

    Args:
        jobs: What is wanted, in the order of measurement.
        store: Where measurements are kept.
        title: What progress calls all of it.
        warm_up: Jobs whose compiled forms the others find; done first if anything is missing, and not kept.
        stream: Where progress is told; stderr by default.

    Raises:
        MissingRequirementError: If several ranks are asked for and there is no mpirun.
    """
    launcher(max(job.ranks for job in jobs) or 1)  # refuses ranks that cannot be started
    for repeat in range(max(job.repeats for job in jobs)):
        wanted = [job for job in jobs if repeat < job.repeats and store.missing(job, repeat)]
        for job in warm_up if wanted and not repeat else ():
            logger.info("warm-up: %s", job.name)
            measure(job)
        words = title if repeat == 0 else f"{title}, repeat {repeat + 1}"
        with show_progress(stream=stream):
            _measure_each(wanted, store, repeat, words)


def _measure_each(jobs: Sequence[Job], store: Store, repeat: int, title: str) -> None:
    """Measure some jobs once each; the time that is left follows from their weights."""
    weights, spent = [job.weight for job in jobs], 0.0
    with Task(title, unit="runs", total=len(jobs)) as task:
        for number, job in enumerate(jobs, 1):
            left = spent * sum(weights[number - 1 :]) / sum(weights[: number - 1]) if spent else None
            task.step(number - 1, words=job.name, left=left)
            start = perf_counter()
            record = measure(job, first=repeat == 0)
            store.write(job, repeat, record)
            spent += perf_counter() - start
            left = spent * sum(weights[number:]) / sum(weights[:number])
            rest = f", {duration(left)} left" if number < len(jobs) else ""
            task.step(number, left=left)
            logger.info("%d/%d %s: %s%s", number, len(jobs), job.name, _outcome(record), rest)


def _outcome(record: Record) -> str:
    if "failed" in record:
        return f"failed: {record['failed']['message']}"
    return f"{record['seconds']:.2f} s" if "seconds" in record else "done"


def summarised(name: str, records: Sequence[Record]) -> Record:
    """Return one record for all measurements of a job.

    Seconds, memory and load become medians, also by phase; everything else is the first one's.

    Args:
        name: Of the job, for errors.
        records: At least one, none of them failed.

    Raises:
        ValueError: If counts differ between measurements.
    """
    first = records[0]
    for key in ("counts", "refused"):
        for record in records[1:]:
            if key in record and record[key] != first.get(key):
                raise ValueError(
                    f"{key} of {name} must be equal in all repetitions, got {first.get(key)} and "
                    f"{record[key]}: find out what is not deterministic"
                )
    result = dict(first)
    for key, value in first.items():
        known = [record[key] for record in records if record.get(key) is not None]
        if key.startswith("phases"):
            result[key] = {name: statistics.median(each.get(name, 0.0) for each in known) for name in value}
        elif known and (key == "ratio" or key.endswith(("seconds", "memory", "load_average"))):
            result[key] = statistics.median(known)
    return result | {"repeats": len(records)}
