"""Start a run in a process of its own, on one rank or several, and wait for its record."""

from __future__ import annotations

import json
import os
import sys
import tempfile
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from fenics_contact.launching import Ending, finished, last_words, launcher
from fenics_contact.study.parameters import Parameters

#: The program of a run: the communicator is for a program to choose, not for the package.
PROGRAM = "from mpi4py import MPI; from fenics_contact.study.worker import main; main(MPI.COMM_WORLD)"

Record = dict[str, Any]


@dataclass(frozen=True)
class Task:
    """One measurement.

    Attributes:
        scene: Name or file of the study.
        parameters: Settings of the run.
        ranks: MPI ranks.
        verify: Whether errors are looked for too.
        limit: Seconds after which it is given up.
    """

    scene: str
    parameters: Parameters
    ranks: int
    verify: bool
    limit: float


def measure(task: Task) -> Record:
    """Run a task and return its record, which says under ``failed`` why there is no answer.

    A record also has the load of the machine over the last minute before it, as ``load_average``.
    """
    load = os.getloadavg()[0]
    with tempfile.TemporaryDirectory() as folder:
        file = Path(folder) / "record.json"
        what = {"scene": task.scene, "parameters": task.parameters.as_dict()}
        words = json.dumps({**what, "file": str(file), "verify": task.verify})
        command = [*launcher(task.ranks), sys.executable, "-c", PROGRAM, words]
        ending = finished(command, task.limit, environment=_environment())
        record = _read(file)
    if record is None:
        record = {"failed": _failure(command, ending, task.limit)}
    return {**record, "load_average": load}


def _environment() -> dict[str, str]:
    """Return the environment of a run: one thread a rank, this very package."""
    kept = dict(os.environ)
    for name in ("OPENBLAS_NUM_THREADS", "OMP_NUM_THREADS"):
        kept.setdefault(name, "1")  # ranks, not threads, share the cores
    package = str(Path(__file__).resolve().parents[2])
    return kept | {"PYTHONPATH": os.pathsep.join(filter(None, [package, kept.get("PYTHONPATH", "")]))}


def _read(file: Path) -> Record | None:
    try:
        record = json.loads(file.read_text(encoding="utf-8"))
    except (OSError, ValueError):
        return None
    return record if isinstance(record, dict) else None


def _failure(command: list[str], ending: Ending, limit: float) -> dict[str, str]:
    if ending.status is None:
        return {"kind": "timeout", "message": f"it did not end within {limit:g} s and was ended"}
    words = last_words(command, ending.output + ending.errors)
    return {"kind": "crash", "message": f"it ended with exit status {ending.status}: {words}"}
