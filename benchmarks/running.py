"""Runs a case in fresh processes and keeps what it measured, so that an interrupted benchmark can go on."""

from __future__ import annotations

import hashlib
import json
import os
import sys
from pathlib import Path
from typing import Any

from benchmarks.plan import Run
from fenics_contact.launching import finished, last_words

ROOT = Path(__file__).resolve().parents[1]
OUTPUT = ROOT / "output" / "benchmarks"
MEASURED = ("fenics_contact", "benchmarks/cases", "demos")

Record = dict[str, Any]


class RunFailed(RuntimeError):
    """A case ended with an error, without a record or not in time."""


def fingerprint(root: Path = ROOT) -> str:
    """Return a short hash of all code that is measured: raw results of other code are not used."""
    digest = hashlib.sha256()
    for folder in MEASURED:
        for path in sorted((root / folder).rglob("*.py")):
            digest.update(f"{path.relative_to(root)}\0".encode() + path.read_bytes())
    return digest.hexdigest()[:12]


def measure(run: Run) -> Record:
    """Run a case once.

    Returns:
        Its record, with the machine's load average over one minute before it.

    Raises:
        RunFailed: With the end of its output.
    """
    load = os.getloadavg()[0]
    threads = [f"OPENBLAS_NUM_THREADS={run.threads}"] if run.threads > 1 else []
    module = [sys.executable, "-m", f"benchmarks.cases.{run.case}", *run.options]
    command = [str(ROOT / "scripts" / "launch.sh"), str(run.ranks), *threads, *module]
    ending = finished(command, run.seconds, folder=ROOT)
    if ending.status is None:
        raise RunFailed(f"{run.name} must end within {run.seconds:g} s, and did not")
    try:
        record = json.loads(ending.output.splitlines()[-1]) if ending.status == 0 else None
    except (IndexError, json.JSONDecodeError):
        record = None
    if not isinstance(record, dict):
        raise RunFailed(
            f"{run.name} must print one JSON object on its last line, got exit status {ending.status} from "
            f"{' '.join(command)} and:\n{last_words(command, ending.output + ending.errors, 3000)}"
        )
    return {**record, "load_average": load}


def raw_file(run: Run, mark: str, repeat: int, folder: Path = OUTPUT) -> Path:
    """Return where one measurement is kept."""
    return folder / "raw" / mark / f"{run.name}-{repeat}.json"


def read(run: Run, mark: str, folder: Path = OUTPUT) -> list[Record]:
    """Return all measurements of a run that are there."""
    found = (raw_file(run, mark, repeat, folder) for repeat in range(run.repeats))
    return [json.loads(path.read_text()) for path in found if path.exists()]
