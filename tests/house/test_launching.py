"""Processes start on ranks from everywhere: beside MPI, under mpirun, and where MPI has left its traces."""

from __future__ import annotations

import inspect
from collections.abc import Callable
from pathlib import Path

import pytest

from fenics_contact import clean_environment
from fenics_contact._base import launching
from fenics_contact._base.launching import last_words, launcher, traces
from fenics_contact.errors import MissingRequirementError
from tests.conftest import LAUNCH, ROOT, launch, read_environment

#: A process without a shell between: its environment is that which MPI_Init wrote into, not `os.environ`.
STARTING = f"""
    import subprocess, sys
    from mpi4py import MPI

    ranks = "import sys; from mpi4py import MPI; sys.stdout.write(str(MPI.COMM_WORLD.size) + chr(10))"
    if MPI.COMM_WORLD.rank == 0:
        for count in ("1", "2"):
            command = [{str(LAUNCH)!r}, count, sys.executable, "-c", ranks]
            done = subprocess.run(command, capture_output=True, text=True)
            sys.stdout.write(f"{{done.returncode}} {{done.stdout}} {{done.stderr}}")
"""
#: What stays although MPI_Init writes it: switches of network libraries, settings of PMIx.
HARMLESS = ("HFI_NO_BACKTRACE", "IPATH_NO_BACKTRACE", "PSM2_DEVICES", "PMIX_MCA_")


@pytest.mark.parametrize("ranks", [1, 2])
def test_ranks_start_from_a_process_that_uses_mpi(ranks: int, mpirun: Callable[..., str]) -> None:
    assert mpirun(STARTING, ranks, timeout=60.0, fresh=True).split() == ["0", "1", "0", "2", "2"]


def test_all_that_mpi_writes_into_the_environment_is_known(mpirun: Callable[..., str]) -> None:
    script = """
        import subprocess, sys

        def environment():
            lines = subprocess.run(["env", "-0"], capture_output=True, text=True).stdout.split("\\0")
            return set(filter(None, lines))

        before = environment()
        from mpi4py import MPI
        sys.stdout.write(" ".join(line.partition("=")[0] for line in environment() - before))
    """
    written = [name for name in mpirun(script, 1, fresh=True).split() if not name.startswith(HARMLESS)]
    assert sorted(written) == sorted(traces(written))


def test_traces_go_and_settings_stay() -> None:
    left = {
        "OMPI_MCA_ess": "singleton", "OMPI_MCA_orte_ess_num_procs": "1", "OMPI_MCA_pmix": "^s1",
        "OMPI_COMM_WORLD_SIZE": "2", "PMIX_RANK": "0", "ORTE_SCHIZO_DETECTION": "ORTE", "PMI_FD": "5",
        "PRTE_LAUNCHED": "1",
    }  # fmt: skip
    kept = {
        "OMPI_MCA_btl": "^tcp", "OMPI_ALLOW_RUN_AS_ROOT": "1", "OPAL_PREFIX": "/opt", "PMIX_MCA_gds": "hash",
        "PRTE_MCA_rmaps_default_mapping_policy": ":oversubscribe", "OMPI_MCA_orte_tmpdir_base": "/scratch",
    }  # fmt: skip
    assert clean_environment({**left, **kept}) == kept


def test_clean_is_the_environment_of_this_process(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setenv("OMPI_MCA_ess", "singleton")
    monkeypatch.setenv("A_SETTING", "of mine")
    environment = clean_environment()
    assert environment["A_SETTING"] == "of mine"
    assert "OMPI_MCA_ess" not in environment


def test_several_ranks_need_mpirun(monkeypatch: pytest.MonkeyPatch) -> None:
    assert launcher(1) == []
    assert launcher(2)[1:] == ["-n", "2"]
    monkeypatch.setattr(launching.os, "access", lambda *_: False)  # type: ignore[attr-defined]
    monkeypatch.setattr(launching.shutil, "which", lambda _: None)  # type: ignore[attr-defined]
    with pytest.raises(MissingRequirementError, match=r"2 ranks need mpirun, found none: install MPI"):
        launcher(2)
    monkeypatch.setattr(launching.sys, "argv", ["launching.py", "2"])  # type: ignore[attr-defined]
    with pytest.raises(SystemExit) as ended:
        launching.main()
    assert ended.value.code == 2


@pytest.mark.parametrize(
    ("version", "options"),
    [
        ("mpirun (Open MPI) 5.0.7", ["--oversubscribe", "--bind-to", "none"]),
        ("", ["--oversubscribe", "--bind-to", "none"]),  # as Ubuntu 26.04 has it
        ("HYDRA build details:", []),
        ("Intel(R) MPI Library for Linux* OS, Version 2021.13", []),
    ],
)
def test_ranks_may_outnumber_the_cores(
    version: str,
    options: list[str],
    tmp_path: Path,
    monkeypatch: pytest.MonkeyPatch,
    capsys: pytest.CaptureFixture[str],
) -> None:
    mpirun = tmp_path / "mpirun"
    mpirun.write_text(f"#!/bin/sh\necho '{version}'\n")
    mpirun.chmod(0o755)
    monkeypatch.setattr(launching, "launcher", lambda ranks: [str(mpirun), "-n", str(ranks)])
    monkeypatch.setattr(launching.sys, "argv", ["launching.py", "4"])  # type: ignore[attr-defined]
    launching.main()
    words = capsys.readouterr().out.split()
    assert words[words.index(str(mpirun)) + 1 :] == [*options, "-n", "4"]
    assert ("OMPI_MCA_mpi_yield_when_idle=1" in words) == bool(options)


@pytest.mark.parametrize(("ranks", "waiting"), [(1, "None"), (2, "1")])
def test_ranks_that_wait_give_their_cores_away_and_a_process_alone_keeps_its_core(
    ranks: int, waiting: str, mpirun: Callable[..., str]
) -> None:
    code = "import os; print(os.environ.get('OMPI_MCA_mpi_yield_when_idle'))"
    assert "OMPI_MCA_mpi_yield_when_idle" not in read_environment(ROOT / "scripts" / "environment")
    assert "".join(mpirun(code, ranks).split()) == waiting * ranks  # ranks may write into one line


def test_a_process_without_a_word_gets_some(monkeypatch: pytest.MonkeyPatch) -> None:
    assert last_words(["mpirun", "x"], " no room\n") == "no room"
    assert last_words(["mpirun", "x"], "a" * 50, most=3) == "aaa"
    monkeypatch.setenv("OMPI_MCA_plm", "slurm")
    words = last_words(["mpirun", "-n", "2", "my script"], "\n")
    assert "nothing and probably could not start: run `mpirun -n 2 'my script'` in a shell" in words
    assert "OMPI_MCA_plm" in words


ALONE = """
    import os, sys
    from pathlib import Path
    from fenics_contact._base.launching import started_alone
    from fenics_contact._base.libraries import MPI

    os.environ["OMPI_MCA_pml"] = "^cm"  # of the user
    before = dict(os.environ)
    with started_alone():
        inside = os.environ.get("OMPI_MCA_ess_singleton_isolated", "none"), os.environ["OMPI_MCA_pml"]
        world = MPI.COMM_WORLD
    added = {name for name in os.environ if name.startswith("OMPI_MCA_ess_singleton")} - before.keys()
    children = Path("/proc/self/task", str(os.getpid()), "children")
    started = len(children.read_text().split()) if children.exists() else 0
    sys.stdout.write(f"{world.size} {inside[0]} {inside[1]} {len(added)} {started} ")
"""


def test_a_program_that_is_alone_starts_mpi_without_a_daemon() -> None:
    answer = launch(1, "-c", inspect.cleandoc(ALONE))
    assert answer.stdout.split() == ["1", "1", "^cm", "0", "0"], answer.stderr


def test_a_program_among_several_starts_mpi_as_mpirun_says() -> None:
    answer = launch(2, "-c", inspect.cleandoc(ALONE))
    assert answer.stdout.split() == ["2", "none", "^cm", "0", "0"] * 2, answer.stderr
