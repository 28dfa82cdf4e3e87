"""Runs a spoilt file through the command line, and says how that ended."""

from __future__ import annotations

import contextlib
import io
import random
import signal
import time
import warnings
from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path

from mpi4py import MPI

from fenics_contact import _cli as cli
from tools.mutated.spoiling import spoilt_bytes, spoilt_text
from tools.mutated.subjects import SUBJECTS

#: Commands end with 0, or with the code of input that cannot be used, with one line that says why.
EXPECTED = (0, int(cli.ExitCode.WRONG_INPUT))


@dataclass(frozen=True)
class Verdict:
    """How the command ended.

    Attributes:
        subject: What was spoilt.
        trouble: What must not be: a traceback, a hang, another exit code; "" if all is well.
        words: The last of what it printed as an error.
        seconds: How long it took.
    """

    subject: str
    seed: int
    code: int
    trouble: str
    words: str
    seconds: float


@contextlib.contextmanager
def _limit(seconds: int) -> Iterator[None]:
    def late(*_: object) -> None:
        raise TimeoutError(f"not done in {seconds} s")

    before = signal.signal(signal.SIGALRM, late)
    signal.alarm(seconds)
    try:
        yield
    finally:
        signal.alarm(0)
        signal.signal(signal.SIGALRM, before)


def run(subject: str, path: Path, seed: int = -1, limit: int = 60) -> Verdict:
    """Plan a file by the command line."""
    start = time.perf_counter()
    code, trouble, words = _planned(path, limit)
    if not trouble and ("Traceback" in words or "TimeoutError" in words):
        trouble = words.strip().splitlines()[-1]
    if not trouble and code not in EXPECTED:
        trouble = f"exit code {code}"
    return Verdict(subject, seed, code, trouble, words.strip(), time.perf_counter() - start)


def _planned(path: Path, limit: int) -> tuple[int, str, str]:
    """Plan a file in this process, where warnings are errors."""
    out, err, code, trouble = io.StringIO(), io.StringIO(), -1, ""
    with contextlib.redirect_stdout(out), contextlib.redirect_stderr(err), warnings.catch_warnings():
        warnings.simplefilter("error")
        try:
            with _limit(limit):
                code = cli.main(MPI.COMM_SELF, ["run", str(path), "--plan"])
        except BaseException as error:  # whatever comes through is what is looked for
            trouble = f"{type(error).__name__}: {error}"
    return code, trouble, err.getvalue()


def judged(subject: str, seed: int, folder: Path) -> Verdict:
    """Spoil a file by a seed, and plan it."""
    path, file = SUBJECTS[subject](folder)
    dice, data = random.Random(f"{subject} {seed}"), file.read_bytes()
    try:
        file.write_text(spoilt_text(data.decode(), dice), encoding="utf-8", newline="")
    except UnicodeDecodeError:
        file.write_bytes(spoilt_bytes(data, dice))
    return run(subject, path, seed)
