"""Runs in processes of their own: crashes and runs without end are recorded, MPI is looked for."""

from __future__ import annotations

import time
from dataclasses import replace
from pathlib import Path

import pytest

from fenics_contact.study import Parameters, launching
from fenics_contact.study.launching import Task, measure

TASK = Task("hertz", Parameters(2), 1, verify=False, limit=60.0)


def test_a_process_that_crashes_is_recorded_with_its_last_words(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(launching, "PROGRAM", "raise SystemExit('out of memory')")
    record = measure(TASK)
    assert record["failed"] == {"kind": "crash", "message": "it ended with exit status 1: out of memory"}
    assert record["load_average"] >= 0.0


def test_a_process_that_writes_no_record_has_failed(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(launching, "PROGRAM", "pass")
    assert measure(TASK)["failed"]["message"].startswith("it ended with exit status 0")


def test_a_process_without_end_is_ended(monkeypatch: pytest.MonkeyPatch, tmp_path: Path) -> None:
    sign = tmp_path / "late"
    code = f"import pathlib, time; time.sleep(2.0); pathlib.Path({str(sign)!r}).touch()"
    monkeypatch.setattr(launching, "PROGRAM", code)
    record = measure(Task("hertz", Parameters(2), 1, verify=False, limit=0.5))
    assert record["failed"] == {"kind": "timeout", "message": "it did not end within 0.5 s and was ended"}
    time.sleep(2.0)
    assert not sign.exists()


def test_a_run_finds_this_package_and_one_thread(monkeypatch: pytest.MonkeyPatch) -> None:
    code = "import os, sys, fenics_contact; sys.exit(fenics_contact.__file__ + os.environ['OMP_NUM_THREADS'])"
    monkeypatch.setattr(launching, "PROGRAM", code)
    monkeypatch.delenv("OMP_NUM_THREADS", raising=False)
    words = measure(TASK)["failed"]["message"]
    assert words.endswith(str(Path(launching.__file__).parents[1] / "__init__.py") + "1")


def test_ranks_of_a_study_start_where_mpi_has_left_its_traces(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setenv("OMPI_MCA_ess", "singleton")
    code = "from mpi4py import MPI; raise SystemExit(f'{MPI.COMM_WORLD.size} ranks')"
    monkeypatch.setattr(launching, "PROGRAM", code)
    message = measure(replace(TASK, ranks=2))["failed"]["message"]
    assert "2 ranks" in message


def test_a_launcher_that_says_nothing_is_told_with_its_command(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(launching, "launcher", lambda ranks: ["false", str(ranks)])
    message = measure(replace(TASK, ranks=2))["failed"]["message"]
    assert message.startswith("it ended with exit status 1: it said nothing, as an mpirun that cannot start")
    assert "`false 2 " in message
