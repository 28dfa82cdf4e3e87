"""What every test stands on: the environment, collected garbage, and scripts run on several ranks."""

from __future__ import annotations

import gc
import os
import subprocess
import sys
import textwrap
from collections.abc import Callable, Iterator
from functools import cache
from pathlib import Path

import hypothesis
import pytest

from tests.waiting_ranks import LAUNCH as LAUNCH
from tests.waiting_ranks import WaitingRanks, kill_session

ROOT = Path(__file__).resolve().parents[1]
#: Numbers of ranks that wait for scripts, once they were asked for.
WAITING = (1, 2, 3, 4)


def read_environment(path: Path) -> dict[str, str]:
    """Read the NAME=VALUE lines of a file, comments left out."""
    lines = (line.strip() for line in path.read_text().splitlines())
    return dict(line.split("=", 1) for line in lines if line and not line.startswith("#"))


# Before anything imports NumPy or MPI: both read their environment once, when they are loaded.
os.environ.update(read_environment(ROOT / "scripts" / "environment"))

# How long an example takes says nothing on cores that ranks share, or while a form is compiled.
hypothesis.settings.register_profile("house", deadline=None)
hypothesis.settings.load_profile("house")


def pytest_collection_modifyitems(items: list[pytest.Item]) -> None:
    """Leave four ranks, which take long on two cores, to the tests that claims rest on."""
    for item in items:
        if isinstance(item, pytest.Function) and hasattr(item, "callspec"):
            if item.callspec.params.get("ranks") == 4:
                item.add_marker(pytest.mark.slow)
                item.add_marker(pytest.mark.claim)


def pytest_collection_finish() -> None:
    """Exempt what the imports left behind from garbage collection, which makes it cheap after each test."""
    gc.collect()
    gc.freeze()
    for ranks in WAITING:
        waiting_ranks(ranks)  # they fit tests that find the environment of now


@pytest.fixture(autouse=True, scope="module")
def exempted_leftovers() -> None:
    """Exempt what earlier modules keep, libraries loaded late above all, as every collection looks at it."""
    gc.collect()
    gc.freeze()


@pytest.fixture(autouse=True)
def collected_garbage() -> Iterator[None]:
    """Destroy what a test leaves behind at one moment on all ranks: PETSc's destructors are collective.

    What fixtures and caches of its module keep is exempted: the next collections need not look at it.
    """
    yield
    gc.collect()
    if communicators_are_few():
        forget_cached_states()
        gc.unfreeze()
        gc.collect()
    gc.freeze()


def communicators_are_few(few: int = 1800) -> bool:
    """Tell whether MPICH has few left; a test that needs no MPI does not start it."""
    if "mpi4py.MPI" not in sys.modules:
        return False
    from fenics_contact._base.libraries import free_communicators  # after the environment is set

    return free_communicators(few) < few


def forget_cached_states() -> None:
    """Empty the caches of all test modules but this one, whose ranks wait."""
    for name, module in list(sys.modules.items()):
        if name.startswith("tests.") and name != __name__:
            for value in list(vars(module).values()):
                if hasattr(value, "cache_clear") and getattr(value, "__module__", "") == name:
                    value.cache_clear()


def launch(ranks: object, *arguments: object, timeout: float = 120.0) -> subprocess.CompletedProcess[str]:
    """Run this interpreter on several ranks, and kill all of them when ``timeout`` seconds have passed.

    Raises:
        subprocess.TimeoutExpired: It did not end in time; the exception holds its output.
    """
    command = [str(LAUNCH), str(ranks), sys.executable, *map(str, arguments)]
    process = subprocess.Popen(
        command,
        stdin=subprocess.DEVNULL,
        stdout=subprocess.PIPE,
        stderr=subprocess.PIPE,
        text=True,
        start_new_session=True,
    )
    try:
        stdout, stderr = process.communicate(timeout=timeout)
    except subprocess.TimeoutExpired:
        kill_session(process.pid)
        stdout, stderr = process.communicate()
        raise subprocess.TimeoutExpired(command, timeout, stdout, stderr) from None
    return subprocess.CompletedProcess(command, process.returncode, stdout, stderr)


def lost_by_mpirun(end: subprocess.CompletedProcess[str]) -> bool:
    """Tell whether a rank ended with status 1 and no word but mpirun's own, as one does that lost its daemon.

    That happens to Open MPI 4.1 now and then. A Python that fails says why.
    """
    words = end.stderr.split("-" * 74)[::2]  # mpirun speaks between such lines
    return end.returncode == 1 and not end.stdout and not "".join(words).strip()


@cache
def waiting_ranks(ranks: int) -> WaitingRanks:
    """Return the ranks that run the scripts of this session."""
    return WaitingRanks(ranks)


def pytest_unconfigure() -> None:
    """End the ranks that wait."""
    for ranks in WAITING:
        waiting_ranks(ranks).end(5.0)


def run_on_ranks(
    script: Path, ranks: int, *arguments: object, timeout: float = 120.0, fresh: bool = False
) -> str:
    """Run a Python script under mpirun and return what it wrote to stdout.

    A run that mpirun lost is started once more.

    Args:
        script: The script.
        ranks: Number of MPI ranks; 1 runs it without mpirun.
        *arguments: What the script finds in ``sys.argv[1:]``.
        timeout: Seconds after which all ranks are killed.
        fresh: Whether it needs new processes; `WAITING` ranks otherwise run several scripts of the session.

    Raises:
        pytest.fail.Exception: It ended with an error or not in time; all its output is in the message.
    """

    def start() -> subprocess.CompletedProcess[str]:
        if fresh or ranks not in WAITING or not waiting_ranks(ranks).fit():
            return launch(ranks, script, *arguments, timeout=timeout)
        return waiting_ranks(ranks)(script, [*map(str, arguments)], timeout)

    end: subprocess.CompletedProcess[str] | subprocess.TimeoutExpired
    try:
        end = start()
        if lost_by_mpirun(end):
            end = start()
        ending = f"ended with exit status {end.returncode}"
        if end.returncode == 0:
            return end.stdout
    except subprocess.TimeoutExpired as late:
        end, ending = late, f"did not end within {timeout:g} s and was killed"
    output = f"--- stdout\n{end.stdout!s}\n--- stderr\n{end.stderr!s}"
    pytest.fail(f"{script.name} on {ranks} ranks {ending}\n{output}", pytrace=False)


@pytest.fixture
def mpirun(tmp_path: Path) -> Callable[..., str]:
    """Return ``mpirun(script, ranks, *arguments, timeout=120.0, fresh=False)``, which runs a script on ranks.

    ``script`` is a path (also as text that ends in ".py") or Python code (indented as the test is); the
    answer is its stdout. See `run_on_ranks`.
    """

    def run(
        script: Path | str, ranks: int, *arguments: object, timeout: float = 120.0, fresh: bool = False
    ) -> str:
        path = Path(script)
        if isinstance(script, str) and not script.endswith(".py"):
            path = tmp_path / "script.py"
            path.write_text(textwrap.dedent(script))
        return run_on_ranks(path, ranks, *arguments, timeout=timeout, fresh=fresh)

    return run
