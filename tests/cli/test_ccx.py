"""`fenics-contact ccx`: what programs that start CalculiX look for."""

from __future__ import annotations

import re
import subprocess
import sys
from pathlib import Path

import pytest
from mpi4py import MPI

from fenics_contact import _cli as cli
from fenics_contact import clean_environment
from tests.decks.texts import PLAIN_BAR, deck, step

BAR = PLAIN_BAR + "*BOUNDARY\nBAR_X0, 1, 3\n" + step("*DLOAD\n4, P4, -1.\n*NODE FILE\nU\n")


def run(*arguments: object) -> int:
    return cli.main(MPI.COMM_SELF, ["ccx", *map(str, arguments)])


def printed(capsys: pytest.CaptureFixture[str]) -> str:
    """Return what is on stdout; any line on stderr is a failure to front ends."""
    out, err = capsys.readouterr()
    assert err == ""
    return out


def test_without_a_job_it_names_calculix(capsys: pytest.CaptureFixture[str]) -> None:
    assert run() == 201
    assert "CalculiX" in printed(capsys)


def test_the_version_is_one_that_front_ends_read(capsys: pytest.CaptureFixture[str]) -> None:
    assert run("-v") == 0
    match = re.search(r"(\d+).(\d+)", printed(capsys))
    assert match is not None
    assert match.groups() == ("2", "20")


@pytest.mark.parametrize("arguments", [["-i ", "{}"], ["{}"], ["-i", "{}", "-o", "frd"], ["-i", "{}.inp"]])
def test_a_job_leaves_its_files(
    arguments: list[str], tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    deck(tmp_path, BAR, "job.inp")
    assert run(*(each.format(tmp_path / "job") for each in arguments)) == 0
    assert sorted(each.name for each in tmp_path.iterdir()) == [
        f"job.{e}" for e in ("cvg", "dat", "frd", "inp", "sta")
    ]
    out = printed(capsys)
    assert "*ERROR" not in out
    assert out.rstrip().endswith("Job finished")


def test_a_refused_deck_is_an_error_and_leaves_nothing(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    path = deck(tmp_path, BAR.replace("*STATIC", "*DYNAMIC"), "job.inp")
    path.with_suffix(".frd").write_text("of another run")
    assert run("-i", path.with_suffix("")) == 2
    out = printed(capsys)
    assert re.search(r"^ \*ERROR job.inp, line \d+: \*DYNAMIC", out, re.MULTILINE)
    assert "Job finished" not in out
    assert [each.name for each in tmp_path.iterdir()] == ["job.inp"]


@pytest.mark.parametrize(
    ("arguments", "words"),
    [
        (["-i", "nowhere/job"], "there must be a deck 'nowhere/job.inp'"),
        (["-i", "job", "-o", "exo"], "results are written as .frd alone, got -o exo"),
        (["-x"], "the option '-x' is not known"),
    ],
)
def test_wrong_arguments_are_errors(
    arguments: list[str], words: str, capsys: pytest.CaptureFixture[str]
) -> None:
    assert run(*arguments) == 2
    assert f" *ERROR {words}" in printed(capsys)


def test_warnings_are_written_to_stdout(tmp_path: Path) -> None:
    soft = BAR.replace("210000.", "2.1")
    deck(tmp_path, soft.replace("4, P4, -1.", "4, P4, -10."), "job.inp")
    command = [sys.executable, "-m", "fenics_contact", "ccx", "-i", "job"]
    done = subprocess.run(command, cwd=tmp_path, env=clean_environment(), capture_output=True, text=True)
    assert (done.returncode, done.stderr) == (0, "")
    assert "is strained by" in done.stdout
