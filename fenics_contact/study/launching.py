"""Start a run in a process of its own, on one rank or several, and wait for its record."""

from __future__ import annotations

import contextlib
import json
import os
import signal
import subprocess
import sys
import tempfile
from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from fenics_contact.launching import clean_environment, last_words, launcher
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
        status, output = _run(command, task.limit)
        record = _read(file)
    if record is None:
        record = {"failed": _failure(command, status, output, task.limit)}
    return {**record, "load_average": load}


def _run(command: list[str], limit: float) -> tuple[int | None, str]:
    """Return exit status, None if it was not over in time, and all output."""
    process = subprocess.Popen(
        command, stdin=subprocess.DEVNULL, stdout=subprocess.PIPE, stderr=subprocess.STDOUT,
        text=True, errors="replace", env=_environment(os.environ), start_new_session=True,
    )  # fmt: skip
    try:
        output, _ = process.communicate(timeout=limit)
        return process.returncode, output
    except subprocess.TimeoutExpired:
        _end(process)
        return None, process.communicate()[0]
    except BaseException:  # an interrupt from the keyboard does not reach a session of its own
        _end(process)
        process.communicate()
        raise


def _end(process: subprocess.Popen[str]) -> None:
    """End a process with all that it started; mpirun needs a moment to end its ranks."""
    process.terminate()
    with contextlib.suppress(subprocess.TimeoutExpired):
        process.wait(timeout=5.0)
    with contextlib.suppress(ProcessLookupError, PermissionError):
        os.killpg(process.pid, signal.SIGKILL)


def _environment(given: Mapping[str, str]) -> dict[str, str]:
    """Return the environment of a run: no traces of MPI, one thread a rank, this very package."""
    kept = clean_environment(given)
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


def _failure(command: list[str], status: int | None, output: str, limit: float) -> dict[str, str]:
    if status is None:
        return {"kind": "timeout", "message": f"it did not end within {limit:g} s and was ended"}
    return {"kind": "crash", "message": f"it ended with exit status {status}: {last_words(command, output)}"}
