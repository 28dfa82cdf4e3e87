"""One run at a time in a folder; a run that is killed stops nobody."""

from __future__ import annotations

import errno
import fcntl
import logging
import os
import subprocess
import sys
from collections.abc import Callable
from pathlib import Path

import pytest
from mpi4py import MPI

from fenics_contact import clean_environment
from fenics_contact.errors import InvalidInputError
from fenics_contact.output import OutputError, only_run_in, write_json
from fenics_contact.output.files import LOCK
from tests.conftest import ROOT

#: Takes the lock of a folder, says so and waits.
HOLDER = """
import sys
from mpi4py import MPI
from fenics_contact.output import only_run_in
with only_run_in(sys.argv[1], MPI.COMM_SELF):
    print("taken", flush=True)
    sys.stdin.read()
"""


def names(folder: Path) -> set[str]:
    return {path.name for path in folder.iterdir()}


def test_a_second_run_is_refused_and_the_first_one_named(tmp_path: Path) -> None:
    with only_run_in(tmp_path / "there", MPI.COMM_SELF):
        words = (
            rf"another one \(process {os.getpid()} on .*, begun 20.*\) writes to '.*there': wait for its end"
        )
        with (
            pytest.raises(InvalidInputError, match=words),
            only_run_in(tmp_path / "there", MPI.COMM_SELF),
        ):
            pytest.fail("it has to be refused")
        with only_run_in(tmp_path, MPI.COMM_SELF):
            assert names(tmp_path) == {"there", LOCK}
    with only_run_in(tmp_path / "there", MPI.COMM_SELF):
        write_json(tmp_path / "there" / "result.json", {})
    assert names(tmp_path / "there") == {"result.json"}


def test_a_folder_that_nothing_was_written_to_is_gone_and_one_that_was_there_stays(tmp_path: Path) -> None:
    (tmp_path / "old").mkdir()
    for name in ("new", "old"):
        with pytest.raises(ZeroDivisionError), only_run_in(tmp_path / name, MPI.COMM_SELF):
            _ = 1 / 0
    assert names(tmp_path) == {"old"}
    assert names(tmp_path / "old") == set()


def test_a_run_that_is_killed_stops_nobody(tmp_path: Path) -> None:
    command = [sys.executable, "-c", HOLDER, str(tmp_path)]
    with subprocess.Popen(
        command,
        stdin=subprocess.PIPE,
        stdout=subprocess.PIPE,
        text=True,
        env=clean_environment() | {"PYTHONPATH": str(ROOT)},
    ) as holder:
        assert holder.stdout is not None
        assert holder.stdout.readline() == "taken\n"
        words = rf"another one \(process {holder.pid} "
        with pytest.raises(InvalidInputError, match=words), only_run_in(tmp_path, MPI.COMM_SELF):
            pytest.fail("it has to be refused")
        holder.kill()
    assert (tmp_path / LOCK).exists(), "a killed run cannot put anything in order"
    with only_run_in(tmp_path, MPI.COMM_SELF):
        assert f"process {os.getpid()} " in (tmp_path / LOCK).read_text()
    assert names(tmp_path) == set()


def test_a_lock_whose_file_was_removed_meanwhile_is_none(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    flock, calls = fcntl.flock, []

    def late(descriptor: int, how: int) -> None:
        calls.append(how)
        if len(calls) == 1:  # its owner ends between the opening and the lock
            (tmp_path / LOCK).unlink()
        flock(descriptor, how)

    monkeypatch.setattr(fcntl, "flock", late)
    with only_run_in(tmp_path, MPI.COMM_SELF):
        assert len(calls) == 2
        assert (tmp_path / LOCK).exists()


def test_where_there_are_no_locks_a_run_goes_on_and_says_so(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, caplog: pytest.LogCaptureFixture
) -> None:
    def none(descriptor: int, how: int) -> None:
        raise OSError(errno.ENOLCK, os.strerror(errno.ENOLCK))

    monkeypatch.setattr(fcntl, "flock", none)
    with caplog.at_level(logging.WARNING), only_run_in(tmp_path, MPI.COMM_SELF):
        assert names(tmp_path) == set()
    assert "no locks there, let no other run write to this folder" in caplog.text


@pytest.mark.parametrize("name", ["file", "file/below", "loop", "a" * 300, "zero\0byte"])
def test_a_folder_that_cannot_be_made_is_named(name: str, tmp_path: Path) -> None:
    (tmp_path / "file").touch()
    (tmp_path / "loop").symlink_to(tmp_path / "loop")
    with (
        pytest.raises(
            OutputError, match=r"results must be written to the folder '.*', which cannot be done: "
        ),
        only_run_in(tmp_path / name, MPI.COMM_SELF),
    ):
        pytest.fail("it has to be refused")


def test_all_ranks_agree_whether_there_is_another_run(mpirun: Callable[..., str], tmp_path: Path) -> None:
    printed = mpirun(
        """
        import sys
        from mpi4py import MPI
        from fenics_contact.errors import InvalidInputError
        from fenics_contact.output import only_run_in
        comm, told = MPI.COMM_WORLD, []
        with only_run_in(sys.argv[1], comm):
            try:
                with only_run_in(sys.argv[1], comm):
                    told.append("both run")
            except InvalidInputError as error:
                told.append("refused" if "another one (process" in str(error) else str(error))
        comm.Barrier()
        with only_run_in(sys.argv[1], comm):
            told.append("free")
        found = comm.gather(told)
        if comm.rank == 0:
            print(found)
        """,
        2,
        tmp_path / "there",
    )
    assert printed == "[['refused', 'free'], ['refused', 'free']]\n"
