"""Ranks that wait for scripts and run one after the other: mpirun and the imports of FEniCSx start once.

`launch.sh 2 python tests/waiting_ranks.py FOLDER` reads requests on each rank from a pipe of its own in the
folder, and answers on a common one. Waiting in a pipe uses no processor, as waiting in MPI would.
"""

from __future__ import annotations

import contextlib
import gc
import json
import logging
import os
import runpy
import select
import shutil
import signal
import subprocess
import sys
import tempfile
import time
import traceback
from pathlib import Path
from typing import Any

LAUNCH = Path(__file__).resolve().parents[1] / "scripts" / "launch.sh"


def kill_session(leader: int) -> None:
    """Kill a process and all its descendants; mpirun gives every rank a process group of its own."""
    for entry in Path("/proc").iterdir():
        if entry.name.isdigit():
            with contextlib.suppress(ProcessLookupError, PermissionError):
                if os.getsid(int(entry.name)) == leader:
                    os.kill(int(entry.name), signal.SIGKILL)


def surroundings() -> list[Any]:
    """Return what a script must leave as it found it, or the next one runs in a new process."""
    logs = [logging.getLogger(name) for name in (None, "fenics_contact")]
    ways = [(log.level, log.propagate, list(log.handlers)) for log in logs]
    stops = [signal.getsignal(number) for number in (signal.SIGINT, signal.SIGTERM)]
    return [dict(os.environ), os.getcwd(), list(sys.path), ways, stops]


def run(script: str, arguments: list[str]) -> int:
    """Run a script as Python would and return its exit status."""
    sys.argv = [script, *arguments]
    try:
        runpy.run_path(script, run_name="__main__")
    except SystemExit as end:
        if end.code is not None and not isinstance(end.code, int):
            sys.stderr.write(f"{end.code}\n")
        return end.code if isinstance(end.code, int) else int(end.code is not None)
    except BaseException:
        traceback.print_exc()
        return 1
    return 0


def serve(folder: Path) -> None:
    """Run what is asked for; all ranks append their output to the same files."""
    from mpi4py import MPI

    answers = os.open(folder / "answers", os.O_WRONLY)
    with open(folder / f"{MPI.COMM_WORLD.rank}") as requests:
        for line in requests:
            script, arguments = json.loads(line)
            for stream, name in ((sys.stdout, "output"), (sys.stderr, "errors")):
                with open(folder / name, "ab") as file:
                    os.dup2(file.fileno(), stream.fileno())
            before = surroundings()
            status = run(script, arguments)
            sys.stdout.flush()
            sys.stderr.flush()
            gc.collect()  # PETSc's destructors are collective: all ranks call them here
            os.write(answers, f"{status} {int(surroundings() != before)}\n".encode())


class WaitingRanks:
    """Ranks that tests start once, and again after a script that failed or changed its process.

    Args:
        ranks: How many.
    """

    def __init__(self, ranks: int) -> None:
        self.ranks, self.found = ranks, self.given()
        self.process: subprocess.Popen[bytes] | None = None

    @staticmethod
    def given() -> tuple[dict[str, str], str]:
        """Return what a new process would find: environment and folder."""
        return {
            name: word for name, word in os.environ.items() if not name.startswith("PYTEST_")
        }, os.getcwd()

    def fit(self) -> bool:
        """Return whether new processes would find what these have found."""
        return self.found == self.given()

    def start(self) -> None:
        """Start the ranks."""
        self.folder = Path(tempfile.mkdtemp(prefix="ranks"))
        for name in ("answers", *map(str, range(self.ranks))):
            os.mkfifo(self.folder / name)
        self.answers = os.open(self.folder / "answers", os.O_RDWR)
        self.requests = [os.open(self.folder / str(rank), os.O_RDWR) for rank in range(self.ranks)]
        command = [str(LAUNCH), str(self.ranks), sys.executable, __file__, str(self.folder)]
        none = subprocess.DEVNULL
        with open(self.folder / "errors", "ab") as errors:
            self.process = subprocess.Popen(
                command, stdin=none, stdout=none, stderr=errors, start_new_session=True
            )

    def end(self, patience: float = 0.0) -> None:
        """Let the ranks come to their end for so many seconds, and kill those that are left."""
        if self.process is not None:
            for descriptor in (self.answers, *self.requests):
                os.close(descriptor)
            with contextlib.suppress(subprocess.TimeoutExpired):
                self.process.wait(patience)
            kill_session(self.process.pid)
            self.process.wait()
            self.process = None
            shutil.rmtree(self.folder)

    def __call__(
        self, script: Path, arguments: list[str], timeout: float
    ) -> subprocess.CompletedProcess[str]:
        """Run a script and return its exit status and its output.

        Raises:
            subprocess.TimeoutExpired: It did not end in time; the exception holds its output.
        """
        if self.process is None:
            self.start()
        assert self.process is not None
        request = json.dumps([str(script), arguments]).encode() + b"\n"
        for descriptor in self.requests:
            os.write(descriptor, request)
        late, answers, status = time.monotonic() + timeout, "", 0
        while not status and answers.count("\n") < self.ranks and time.monotonic() < late:
            if select.select([self.answers], [], [], 0.1)[0]:
                answers += os.read(self.answers, 4096).decode()
                status = max(abs(int(line.split()[0])) for line in answers.splitlines())
            elif self.process.poll() is not None:
                status = self.process.returncode or 1
        written = [(self.folder / name).read_text() for name in ("output", "errors")]
        if status or "1" in answers.split()[1::2] or answers.count("\n") < self.ranks:
            self.end()
        else:
            for name in ("output", "errors"):
                os.truncate(self.folder / name, 0)
        if not status and answers.count("\n") < self.ranks:
            raise subprocess.TimeoutExpired(str(script), timeout, *written)
        return subprocess.CompletedProcess([str(script), *arguments], status, *written)


if __name__ == "__main__":
    with contextlib.suppress(KeyboardInterrupt):
        serve(Path(sys.argv[1]))
