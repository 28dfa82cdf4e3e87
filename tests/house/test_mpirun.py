"""The fixture that runs scripts on several ranks returns their words, and shows their failures."""

from __future__ import annotations

import os
import time
from collections.abc import Callable
from contextlib import nullcontext
from pathlib import Path

import pytest
from mpi4py import MPI

from tests.conftest import ROOT, launch, read_environment

RANKS = """
    import sys
    from mpi4py import MPI
    sys.stdout.write(f"rank {MPI.COMM_WORLD.rank} of {MPI.COMM_WORLD.size} {sys.argv[1:]}\\n")
"""


@pytest.mark.parametrize("fresh", [False, True])
@pytest.mark.parametrize("ranks", [1, 2, 4])
def test_code_runs_on_that_many_ranks_with_its_arguments(
    mpirun: Callable[..., str], ranks: int, fresh: bool
) -> None:
    lines = mpirun(RANKS, ranks, "a", 3, fresh=fresh).splitlines()
    assert sorted(lines) == [f"rank {rank} of {ranks} ['a', '3']" for rank in range(ranks)]


def test_a_script_runs_from_its_path(mpirun: Callable[..., str], tmp_path: Path) -> None:
    script = tmp_path / "greeting.py"
    script.write_text("import sys; sys.stdout.write('hello\\n')")
    assert mpirun(script, 2) == mpirun(str(script), 2) == "hello\nhello\n"


def test_mpirun_itself_is_quiet() -> None:
    answer = launch(3, "-c", "from mpi4py import MPI; MPI.COMM_WORLD.allreduce(1)")
    assert (answer.returncode, answer.stdout, answer.stderr) == (0, "", "")


def test_ranks_start_beside_a_process_that_uses_mpi_itself(mpirun: Callable[..., str]) -> None:
    assert MPI.Is_initialized()
    assert sorted(mpirun(RANKS, 2, fresh=True).splitlines()) == ["rank 0 of 2 []", "rank 1 of 2 []"]


PID = "import os, sys; sys.stdout.write(f'{os.getpid()} ')\n"


@pytest.mark.parametrize(
    ("script", "alike"),
    [
        ("", True),
        ("import sys; sys.exit()", True),
        ("import os; os.environ['ELSEWHERE'] = '1'", False),
        ("import logging; logging.getLogger('fenics_contact').setLevel(10)", False),
        ("raise SystemExit(3)", False),
        ("raise SystemExit('said with status 1')", False),
    ],
)
def test_ranks_run_the_next_script_unless_one_has_failed_or_changed_them(
    mpirun: Callable[..., str], script: str, alike: bool
) -> None:
    before = mpirun(PID, 2)
    fails = pytest.raises(pytest.fail.Exception, match=r"status 3|(?s:status 1.*said with status 1)")
    with fails if "raise" in script else nullcontext():
        mpirun(script, 2)
    assert (sorted(mpirun(PID, 2).split()) == sorted(before.split())) is alike


def test_ranks_that_wait_run_nothing_in_another_environment(
    mpirun: Callable[..., str], monkeypatch: pytest.MonkeyPatch, tmp_path: Path
) -> None:
    monkeypatch.setenv("ELSEWHERE", "1")
    assert mpirun("import os, sys; sys.stdout.write(os.environ['ELSEWHERE'])", 2) == "11"
    monkeypatch.undo()
    monkeypatch.chdir(tmp_path)
    assert mpirun("import os, sys; sys.stdout.write(os.getcwd())", 1) == str(tmp_path)


@pytest.mark.parametrize("ranks", ["0", "-1", "two", ""])
def test_a_number_of_ranks_that_is_none_is_refused(ranks: str) -> None:
    answer = launch(ranks, "-V")
    assert answer.returncode == 2
    assert f"with a positive number of ranks, got: {ranks}" in answer.stderr


def test_a_failure_on_one_rank_fails_with_the_output_shown(mpirun: Callable[..., str]) -> None:
    code = """
        import sys
        from mpi4py import MPI
        sys.stdout.write("before the error\\n")
        sys.stdout.flush()
        if MPI.COMM_WORLD.rank == 1:
            raise ValueError("rank one is unwell")
    """
    with pytest.raises(pytest.fail.Exception) as caught:
        mpirun(code, 2)
    message = str(caught.value)
    assert "on 2 ranks ended with exit status 1" in message
    assert "before the error" in message
    assert "ValueError: rank one is unwell" in message


@pytest.mark.parametrize("fresh", [False, True])
@pytest.mark.parametrize(("word", "runs"), [("", 2), ("unwell", 1)])
def test_a_run_that_ends_without_a_word_is_started_once_more(
    mpirun: Callable[..., str], tmp_path: Path, word: str, runs: int, fresh: bool
) -> None:
    code = """
        import os, pathlib, sys
        from mpi4py import MPI
        if MPI.COMM_WORLD.rank == MPI.COMM_WORLD.size - 1:
            count = pathlib.Path(sys.argv[1], "count")
            count.write_text(count.read_text() + "." if count.exists() else ".")
            sys.stderr.write(sys.argv[2])
            sys.stderr.flush()
            os._exit(1)
        MPI.COMM_WORLD.Barrier()
    """
    with pytest.raises(pytest.fail.Exception, match="ended with exit status 1"):
        mpirun(code, 2, tmp_path, word, fresh=fresh)
    assert (tmp_path / "count").read_text() == runs * "."


@pytest.mark.parametrize("fresh", [False, True])
def test_ranks_that_hang_are_killed(mpirun: Callable[..., str], tmp_path: Path, fresh: bool) -> None:
    code = """
        import os, pathlib, sys, time
        from mpi4py import MPI
        pathlib.Path(sys.argv[1], f"{MPI.COMM_WORLD.rank}.pid").write_text(str(os.getpid()))
        MPI.COMM_WORLD.Barrier()
        time.sleep(600)
    """
    with pytest.raises(pytest.fail.Exception, match="did not end within 5 s and was killed"):
        mpirun(code, 2, tmp_path, timeout=5, fresh=fresh)
    pids = [int(path.read_text()) for path in tmp_path.glob("*.pid")]
    assert len(pids) == 2
    time.sleep(0.2)
    assert [pid for pid in pids if _runs(pid)] == []


def _runs(pid: int) -> bool:
    """Tell whether a process is there and not only waiting for its parent to notice its end."""
    try:
        return Path(f"/proc/{pid}/stat").read_text().rpartition(")")[2].split()[0] != "Z"
    except (FileNotFoundError, ProcessLookupError):
        return False


def test_every_process_uses_one_blas_thread(mpirun: Callable[..., str]) -> None:
    code = "import os, sys; sys.stdout.write(os.environ['OPENBLAS_NUM_THREADS'])"
    assert os.environ["OPENBLAS_NUM_THREADS"] == "1"
    assert mpirun(code, 1) == "1"


def test_the_environment_file_is_read_without_its_comments() -> None:
    environment = read_environment(ROOT / "scripts" / "environment")
    assert environment["OMPI_MCA_btl"] == "^tcp,openib,uct,ofi"
    assert len(environment) > 5
    assert all(name.isidentifier() for name in environment)
