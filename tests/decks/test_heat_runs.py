"""`fenics-contact run` of decks that conduct heat: plans, tables and files as those of decks of mechanics."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest
from mpi4py import MPI

from fenics_contact import _cli as cli
from fenics_contact.decks import DeckError, read_deck, read_heat_deck, run_job
from fenics_contact.output import read_result
from tests.decks.hot_bars import ALL, BAR, CLAMPED, COLD, EXPANDS, START, WARM, steady
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
    printed = capsys.readouterr().out.splitlines()
    assert sum("is before heat is computed: NT of this step is not written" in line for line in printed) == 1
    lines = [line for line in printed if line.startswith("step ")]
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


def test_a_static_step_has_the_temperatures_of_an_earlier_job(tmp_path: Path) -> None:
    asked = "*NODE FILE\nNT\n*END STEP\n"
    hotter = steady("*BOUNDARY\nBAR_X1, 11, 11, 100.\n").replace("*END STEP\n", asked)
    run_job(deck(tmp_path, EXPANDS + steady(WARM) + hotter, "warm.inp"), MPI.COMM_SELF)
    steps = (
        f"*STEP\n*STATIC\n{CLAMPED}*TEMPERATURE, FILE=warm.frd, BSTEP=2\n*END STEP\n"
        '*STEP\n*STATIC\n*TEMPERATURE, FILE="warm.frd"\n*END STEP\n'
    )
    found = read_deck(deck(tmp_path, EXPANDS + steps))
    end = found.scene.bodies["BAR"].mesh.points[:, 0] > 4.0 - 1e-9
    moved = [state.gather_displacement("BAR")[end, 0].mean() for state in found.solve(MPI.COMM_SELF)]
    assert moved == pytest.approx([4.0 * 1e-5 * 40.0, 4.0 * 1e-5 * 20.0], rel=1e-5)


def test_mechanics_is_refused_when_a_deck_is_read(tmp_path: Path) -> None:
    with pytest.raises(DeckError, match=r"needs \*ELASTIC or \*HYPERELASTIC behind it"):
        read_heat_deck(deck(tmp_path, BAR + UNCOUPLED))


@pytest.mark.parametrize(
    ("card", "words"),
    [
        ("*TEMPERATURE, FILE=cold.frd\n", "there must be a file of results, .frd, 'cold.frd'"),
        ("*TEMPERATURE, BSTEP=2\n", "there must be a file of results, .frd, ''"),
        (
            "*TEMPERATURE, FILE=warm.frd, BSTEP=2\n",
            "needs NT of step 2 in 'warm.frd', and no lines: write it",
        ),
        ("*TEMPERATURE, FILE=warm.frd\n1, 5.\n", "needs NT of step 1 in 'warm.frd', and no lines"),
    ],
)
def test_files_without_the_temperatures_of_a_step_are_refused(tmp_path: Path, card: str, words: str) -> None:
    run_job(deck(tmp_path, EXPANDS + steady(WARM), "warm.inp"), MPI.COMM_SELF)
    with pytest.raises(DeckError, match=words):
        read_deck(deck(tmp_path, EXPANDS + f"*STEP\n*STATIC\n{CLAMPED}{card}*END STEP\n"))


@pytest.mark.parametrize(
    ("card", "words"),
    [
        ("*FILM, FILM AMPLITUDE=A\n4, F4, 1., 1.\n", r"\*FILM: the parameter FILMAMPLITUDE is not read"),
        ("*RADIATE, CAVITY=A\n4, R4, 1., 1.\n", r"\*RADIATE: the parameter CAVITY is not read"),
        ("*RADIATE\n4, R4CR, 1., 1.\n", "radiation between the surfaces of a cavity is not solved"),
        ("*TEMPERATURE\nBAR_X1, 5.\n", r"\*TEMPERATURE: is not known before it is computed: hold it by"),
        (
            "*BOUNDARY\nBAR_X1, 1, 11, 5.\n",
            r"\*BOUNDARY: needs node or set, 11 and a number, got component '1'",
        ),
        ("*BOUNDARY, FIXED\nBAR_X1, 11\n", r"\*BOUNDARY: holds temperatures by their values alone"),
        ("*VIEWFACTOR, READ\n", r"\*VIEWFACTOR: cavities, whose surfaces see each other, are not solved"),
    ],
)
def test_what_is_asked_for_and_not_done_is_refused_by_name(tmp_path: Path, card: str, words: str) -> None:
    with pytest.raises(DeckError, match=words):
        read_heat_deck(deck(tmp_path, BAR + steady(COLD + card)))


def test_fluxes_sources_and_surroundings_follow_amplitudes(tmp_path: Path) -> None:
    grows = ALL + START + "*AMPLITUDE, NAME=GROWS\n0., 0., 4., 1.\n"
    cards = (
        "*CFLUX, AMPLITUDE=GROWS\nBAR_X1, 11, 0.1\n*DFLUX, AMPLITUDE=GROWS\n4, S4, 0.4\nBAR, BF, 0.2\n"
        "*FILM, AMPLITUDE=GROWS\n1, F6, 80., 0.1\n"
    )
    text = BAR + grows + f"*STEP\n*HEAT TRANSFER, DIRECT\n1., 2.\n{cards}*END STEP\n"
    states = [state for _, _, state in read_heat_deck(deck(tmp_path, text)).increments(MPI.COMM_SELF)]
    parts = states[-1].balance.by_part
    found = {name.split()[0]: value for name, value in parts.items()}
    assert found["HeatAtNodes"] == pytest.approx(0.5 * 4 * 0.1)
    assert found["HeatFlux"] == pytest.approx(0.5 * 0.4)
    assert found["HeatSource"] == pytest.approx(0.5 * 4.0 * 0.2)
    cold = states[-1].temperature["BAR"][:1].min()
    assert found["Convection"] == pytest.approx(
        0.1 * (0.5 * 80.0 - cold), abs=0.1 * np.ptp(states[-1].values)
    )


def test_parameters_without_effect_are_in_the_notes(tmp_path: Path) -> None:
    text = BAR + steady(COLD).replace("STEADY STATE", "STEADY STATE, DELTMX=5., TIME RESET")
    notes = read_heat_deck(deck(tmp_path, text)).notes
    assert any("DELTMX has no effect here, where steps in time have an error" in note for note in notes)
    assert any("TIMERESET has no effect here" in note for note in notes)
