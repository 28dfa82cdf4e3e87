"""`fenics-contact run` of decks that conduct heat: plans, tables and files as those of decks of mechanics."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest
from mpi4py import MPI

from fenics_contact import _cli as cli
from fenics_contact.output import read_result
from tests.decks.hot_bars import BAR, CLAMPED, COLD, EXPANDS, WARM, steady
from tests.decks.texts import deck

ASKED = "*NODE PRINT, NSET=BAR_X1, TOTALS=YES\nNT, RFL, U\n*EL PRINT, ELSET=BAR\nHFL\n*END STEP\n"
UNCOUPLED = f"*STEP\n*UNCOUPLED TEMPERATURE-DISPLACEMENT, STEADY STATE\n{CLAMPED}{WARM}*END STEP\n"
FILM = steady(COLD + "*FILM\n4, F4, 100., 0.3\n")


def run(path: Path, *arguments: str) -> int:
    given = ["run", str(path), "-o", str(path.parent / "out"), "--no-pictures", *arguments]
    return cli.main(MPI.COMM_SELF, given)


def table(folder: Path, step: int, head: str) -> np.ndarray:
    """The rows behind a head, of the file of a step."""
    lines = (folder / "out" / "prints" / f"step_{step}.dat").read_text().splitlines()
    start = next(k for k, line in enumerate(lines) if line.startswith(f" {head}")) + 2
    rows = [line.split() for line in [*lines[start:], ""]]
    return np.array(rows[: rows.index([])], dtype=float)


def test_a_run_writes_what_the_deck_prints_of_heat_and_of_mechanics(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    path = deck(tmp_path, EXPANDS + UNCOUPLED.replace("*END STEP\n", ASKED))
    assert run(path, "--set", "output.files=['vtu', 'csv']") == 0
    printed = capsys.readouterr().out
    assert "step 1, time 1, BAR 20 to 60" in printed
    assert "has no effect" not in printed, "cards of heat have one"
    assert table(tmp_path, 1, "temperatures for set BAR_X1")[:, 1] == pytest.approx([60.0] * 4)
    heat = 0.4 * 10.0
    assert table(tmp_path, 1, "total heat generation for set BAR_X1") == pytest.approx(heat)
    flux = table(tmp_path, 1, "heat flux (elem, integ.pnt.,qx,qy,qz) for set BAR")
    assert flux[:, 2:] == pytest.approx(np.tile([-heat, 0.0, 0.0], (32, 1)), abs=1e-6)
    assert table(tmp_path, 1, "displacements (vx,vy,vz) for set BAR_X1")[:, 1].mean() == pytest.approx(
        8e-4, rel=1e-5
    )
    assert read_result(tmp_path / "out")["heat"]["temperature"]["BAR"] == pytest.approx([20.0, 60.0])
    assert {each.name for each in (tmp_path / "out").iterdir()} == {
        "result.json", "history.pvd", "history", "prints", "steps.csv",
    }  # fmt: skip


def test_a_run_goes_through_steps_of_heat_and_of_statics_in_time(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    steps = f"*STEP\n*STATIC\n{CLAMPED}*END STEP\n" + steady(WARM) + "*STEP\n*STATIC\n*END STEP\n"
    assert run(deck(tmp_path, EXPANDS + steps.replace("*END STEP\n", ASKED))) == 0
    lines = [line for line in capsys.readouterr().out.splitlines() if line.startswith("step ")]
    assert [line[:14] for line in lines] == [
        "step 1, time 1",
        "step 2, time 2",
        "step 3, time 3",
    ]
    ends = [table(tmp_path, k, "displacements (vx,vy,vz) for set BAR_X1")[:, 1].mean() for k in (1, 3)]
    assert ends == pytest.approx([0.0, 8e-4], rel=1e-5, abs=1e-12)
    warm = [table(tmp_path, k, "temperatures for set BAR_X1")[:, 1].mean() for k in (2, 3)]
    assert warm == pytest.approx([60.0, 60.0])
    assert "displacements" not in (tmp_path / "out" / "prints" / "step_2.dat").read_text()


def test_plans_of_decks_of_heat_solve_nothing(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    assert run(deck(tmp_path, BAR + FILM), "--plan") == 0
    printed = capsys.readouterr().out
    assert "heat            conducting body (1); held temperature (1); convection (1)" in printed
    assert "nothing was solved, this is the plan" in printed
    assert run(deck(tmp_path, EXPANDS + UNCOUPLED), "--plan") == 0
    assert "elasticity (1 elastic body)" in capsys.readouterr().out
    assert not (tmp_path / "out").exists()


@pytest.mark.parametrize(
    ("text", "arguments", "words"),
    [
        (BAR + FILM, ("--tolerance", "1e-6"), "solver.tolerance has no meaning in this file of heat alone"),
        (BAR + FILM, ("--set", "heat.materials={}"), "--set changes solver, accuracy, output, units and"),
        (BAR + FILM, ("--statics-only",), "the first step is not static"),
        (BAR + UNCOUPLED, (), "needs *ELASTIC or *HYPERELASTIC behind it"),
        (EXPANDS + UNCOUPLED.replace("*END", "*CLOAD\n99, 1, 1.\n*END"), (), "node 99"),
    ],
)
def test_runs_that_are_not_solved_are_refused_before_heat_is(
    tmp_path: Path, capsys: pytest.CaptureFixture[str], text: str, arguments: tuple[str, ...], words: str
) -> None:
    assert run(deck(tmp_path, text), *arguments) == 2
    printed = capsys.readouterr()
    assert words in printed.err
    assert printed.out == ""
