"""Decks that conduct heat: closed forms, numbers of CalculiX 2.20, and what is refused by name."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest
from mpi4py import MPI

from fenics_contact.decks import DeckError, HeatDeck, Increment, read_deck, read_heat_deck, run_job
from fenics_contact.errors import InvalidInputError
from fenics_contact.gallery import block, rectangle
from fenics_contact.heat import HeatState
from fenics_contact.mesh import quadratic
from tests.decks.hot_bars import (
    ALL,
    BAR,
    CLAMPED,
    COLD,
    COPPER,
    DRY,
    ENDS,
    EXPANDS,
    MESH,
    PAIR,
    SECTION,
    START,
    TWO,
    WARM,
    steady,
)  # fmt: skip
from tests.decks.texts import deck, mesh_cards
from tests.frd_files import read_frd

CONSTANTS = "*PHYSICAL CONSTANTS, ABSOLUTE ZERO=-273.15, STEFAN BOLTZMANN=5.67E-11\n"


def solved(folder: Path, text: str) -> tuple[HeatDeck, list[HeatState]]:
    found = read_heat_deck(deck(folder, text), MPI.COMM_SELF)
    return found, found.solve(MPI.COMM_SELF)


def temperatures(found: HeatDeck, state: HeatState) -> dict[int, float]:
    """Temperatures by the numbers of the nodes in the deck."""
    known = {}
    for body, numbers in found.frame.node_numbers.items():
        known |= dict(zip(numbers.tolist(), state.temperature[body], strict=True))
    return known


def at_end(folder: Path, load: str, model: str = BAR) -> float:
    """The temperature at x = 4 of a bar that is held at 20 at x = 0."""
    found, (state,) = solved(folder, model + steady(COLD + load))
    (body,) = found.bodies.values()
    end = body.mesh.points[:, 0] > 4.0 - 1e-9
    values = state.temperature["BAR"][end]
    assert np.ptp(values) < 1e-9
    assert state.balance.error < 1e-11
    return float(values.mean())


@pytest.mark.parametrize(
    ("load", "expected"),
    [
        ("*DFLUX\n4, S4, 0.2\n", 20.0 + 0.2 * 4.0 / 0.4),
        ("*DFLUX\nTIP, S, 0.2\n", 20.0 + 0.2 * 4.0 / 0.4),
        ("*DFLUX\nBAR, BF, 0.2\n", 20.0 + 0.2 * 8.0 / 0.4),
        ("*DFLUX\nLAST, BF, 0.2\n", 20.0 + 0.2 * 3.5 / 0.4),
        ("*CFLUX\nBAR_X1, 11, 0.05\n", 20.0 + 0.2 * 4.0 / 0.4),
        ("*CFLUX\nBAR_X1, 11, 7.\nBAR_X1, 0, 0.05\n", 20.0 + 0.2 * 4.0 / 0.4),
        ("*FILM\n4, F4, 100., 0.3\n", 20.0 + 80.0 * 0.3 / (0.3 + 0.1)),
        ("*FILM\nTIP, F, 100., 0.3\n", 20.0 + 80.0 * 0.3 / (0.3 + 0.1)),
        ("*FILM\nTIP, F, 7., 9.\n*FILM\n4, F4, 100., 0.3\n", 20.0 + 80.0 * 0.3 / (0.3 + 0.1)),
    ],
)
def test_loads_heat_a_bar_as_in_closed_form(tmp_path: Path, load: str, expected: float) -> None:
    named = "*SURFACE, NAME=TIP\n4, S4\n*ELSET, ELSET=LAST\n4\n"
    assert at_end(tmp_path, load, BAR + named) == pytest.approx(expected, rel=1e-10)


def test_a_face_radiates_with_the_constants_of_the_deck(tmp_path: Path) -> None:
    end = at_end(tmp_path, "*RADIATE\n4, R4, 900., 0.8\n", BAR + CONSTANTS)
    assert end > 25.0
    gained = 0.8 * 5.67e-11 * ((900.0 + 273.15) ** 4 - (end + 273.15) ** 4)
    assert 0.1 * (end - 20.0) == pytest.approx(gained, rel=1e-9)


def test_elements_of_heat_and_of_mechanics_conduct_alike(tmp_path: Path) -> None:
    ends = [
        at_end(tmp_path, "*DFLUX\n4, S4, 0.2\n", BAR.replace("C3D8", kind))
        for kind in ("DC3D8", "C3D8R", "C3D8I")
    ]
    assert ends == pytest.approx([22.0] * 3, rel=1e-10)


def test_conductivity_follows_the_temperature(tmp_path: Path) -> None:
    # k = 0.4 + 0.001 (T − 20): the integral of k from 20 to T is q L.
    given = BAR.replace("*CONDUCTIVITY\n0.4\n", "*CONDUCTIVITY\n0.4, 20.\n1.4, 1020.\n")
    rise = at_end(tmp_path, "*DFLUX\n4, S4, 20.\n", given) - 20.0
    assert 0.4 * rise + 0.0005 * rise**2 == pytest.approx(20.0 * 4.0, rel=1e-3)


def test_conductivity_may_jump_within_cells(tmp_path: Path) -> None:
    # From 20 to 52 in the first cell, from there to 100 in three that conduct twice as well.
    jump = "*CONDUCTIVITY\n0.4, 0.\n0.4, 52.\n0.8, 52.0001\n"
    given = BAR.replace("*CONDUCTIVITY\n0.4\n", jump)
    assert at_end(tmp_path, "*DFLUX\n4, S4, 12.8\n", given) == pytest.approx(100.0, abs=1e-3)


@pytest.mark.parametrize(
    ("card", "along"),
    [
        ("*CONDUCTIVITY, TYPE=ORTHO\n0.4, 7., 9.\n", 0.4),
        ("*CONDUCTIVITY, TYPE=ANISO\n0.4, 7., 9., 0., 0., 0.5\n", 0.4),
        ("*CONDUCTIVITY, TYPE=ORTHO\n7., 0.5, 9.\n", 0.5),
    ],
)
def test_conductivity_has_axes(tmp_path: Path, card: str, along: float) -> None:
    axes = "*ORIENTATION, NAME=TURNED\n0., 1., 0., -1., 0., 0.\n" if along == 0.5 else ""
    section = SECTION.replace("\n", ", ORIENTATION=TURNED\n") if axes else SECTION
    model = MESH + COPPER.replace("*CONDUCTIVITY\n0.4\n", card) + axes + section
    assert at_end(tmp_path, "*DFLUX\n4, S4, 0.2\n", model) == pytest.approx(20.0 + 0.8 / along, rel=1e-10)


def test_plane_bodies_have_their_thickness_and_rings_their_turn(tmp_path: Path) -> None:
    mesh = mesh_cards({"BAR": quadratic(rectangle((1, 0), (5, 1), (4, 1)))}, element="DC2D8")
    section = SECTION + "2.5\n"
    held = "*BOUNDARY\nBAR_X0, 11, , 20.\nBAR_X1, 11, , 60.\n"
    found, (plane,) = solved(tmp_path, mesh + COPPER + section + steady(held))
    assert found.bodies["BAR"].thickness == 2.5
    heat = [value for name, value in plane.balance.by_part.items() if name.startswith("Held")]
    assert sorted(heat) == pytest.approx([-10.0, 10.0], rel=1e-10)
    found, (ring,) = solved(tmp_path, mesh.replace("DC2D8", "DCAX8") + COPPER + SECTION + steady(held))
    heat = [value for name, value in ring.balance.by_part.items() if name.startswith("Held")]
    assert max(heat) == pytest.approx(2.0 * np.pi * 0.4 * 40.0 / np.log(5.0), rel=1e-3)


@pytest.mark.parametrize(
    ("joint", "resistance"),
    [
        ("*TIE, NAME=GLUE\nABOVE, BELOW\n", 10.0),
        (DRY + "*GAP CONDUCTANCE\n0.1\n" + PAIR, 20.0),
        (DRY + "*GAP CONDUCTANCE\n0.5, 10.\n0.1, 0.\n" + PAIR, 20.0),
    ],
)
def test_heat_passes_between_bodies(tmp_path: Path, joint: str, resistance: float) -> None:
    _, (state,) = solved(tmp_path, TWO + joint + steady(ENDS))
    heat = [value for name, value in state.balance.by_part.items() if name.startswith("Held")]
    assert max(heat) == pytest.approx(100.0 / resistance, rel=1e-9)


def test_pairs_without_a_conductance_pass_nothing_and_say_so(tmp_path: Path) -> None:
    found, (state,) = solved(tmp_path, TWO + DRY + PAIR + steady(ENDS))
    assert state.temperature["UP"] == pytest.approx(100.0)
    assert any(
        "passes no heat: its interaction has no *GAP CONDUCTANCE" in note for note in found.frame.notes
    )


def test_steps_keep_what_others_do_not_replace(tmp_path: Path) -> None:
    more = steady("*DFLUX\n4, S4, 0.4\n") + steady("*DFLUX, OP=NEW\n3, S3, 0.\n*CFLUX\nBAR_X1, 11, 0.05\n")
    more += steady("*CFLUX, OP=NEW\n*BOUNDARY, OP=NEW\nBAR_X1, 11, 11, 5.\n")
    found, states = solved(tmp_path, BAR + steady(COLD + "*DFLUX\n4, S4, 0.2\n") + more)
    ends = [temperatures(found, state)[max(found.frame.node_numbers["BAR"])] for state in states]
    assert ends == pytest.approx([22.0, 24.0, 22.0, 5.0], rel=1e-10)
    assert states[-1].temperature["BAR"] == pytest.approx(5.0)


def test_what_holds_bodies_has_no_effect_on_heat_and_notes_say_so(tmp_path: Path) -> None:
    held = "*BOUNDARY\nBAR_X0, 1, 3\n*EXPANSION\n1.E-5\n"
    found, (state,) = solved(tmp_path, MESH + COPPER + held + SECTION + steady(COLD))
    assert state.temperature["BAR"] == pytest.approx(20.0)
    assert any(
        note.startswith("*EXPANSION,") and note.endswith("has no effect on heat")
        for note in found.frame.notes
    )


REFUSED = {
    "1, R1CR, 300., 0.8": ("*RADIATE", "R1CR: radiation between the surfaces of a cavity is not solved"),
    "1, F1FC, 21, 0.8": ("*FILM", "F1FC: fluid networks are not solved"),
    "1, S1NU, 1.": ("*DFLUX", "S1NU: fluxes and films of user routines are not read"),
    "1, P1, 1.": ("*DFLUX", "load 'P1' is not supported: give S1, S2, ... of elements"),
    "1, F1, 20.": ("*FILM", "needs 2 numbers behind 'F1', got 1: add them"),
    "1, R1, 20., 0.5": ("*RADIATE", r"needs \*PHYSICAL CONSTANTS with ABSOLUTE ZERO="),
    "BAR_X1, 3, 20.": ("*CFLUX", "needs node or set, 11 and a number, got component '3'"),
    "3, S4, 1.": (
        "*DFLUX",
        "heat must enter on the boundary of a body, a face of element 3 lies between two",
    ),
}


@pytest.mark.parametrize("line", REFUSED)
def test_loads_that_are_not_solved_are_refused_by_name(tmp_path: Path, line: str) -> None:
    card, words = REFUSED[line]
    with pytest.raises(DeckError, match=words):
        read_heat_deck(deck(tmp_path, BAR + steady(f"{COLD}{card}\n{line}\n")))


@pytest.mark.parametrize(
    ("text", "words"),
    [
        (BAR.replace("C3D8", "S8"), "elements of type S8 do not conduct heat here"),
        (BAR.replace("*CONDUCTIVITY\n0.4\n", ""), r"conducts no heat: add \*CONDUCTIVITY behind it"),
        (BAR.replace("*CONDUCTIVITY\n0.4\n", "*CONDUCTIVITY\n-1.\n"), "must be positive"),
        (BAR.replace("*CONDUCTIVITY\n", "*CONDUCTIVITY, TYPE=ODD\n"), "TYPE=ODD is not read"),
        (BAR.replace("9.E-6\n", "9.E-6, 0.\n8.E-6, 99.\n"), "must not depend on the temperature, as mass is"),
        (BAR + "*EQUATION\n2\n1, 11, 1., 2, 11, -1.\n", "equations of temperatures are not solved"),
        (
            TWO + PAIR + DRY + "*GAP CONDUCTANCE\n1., 0.\n0.5, 3.\n",
            "lines have a conductance and its pressure",
        ),
    ],
)
def test_models_that_are_not_solved_are_refused_by_name(tmp_path: Path, text: str, words: str) -> None:
    with pytest.raises(DeckError, match=words):
        read_heat_deck(deck(tmp_path, text + steady(ENDS if text.startswith(TWO) else COLD)))


def test_decks_of_statics_name_what_conducts(tmp_path: Path) -> None:
    static = "*STEP\n*STATIC\n*FILM\n1, F1, 20., 1.\n*END STEP\n"
    with pytest.raises(DeckError, match=r"heat is conducted in decks with \*HEAT TRANSFER"):
        read_deck(deck(tmp_path, BAR + static))
    with pytest.raises(DeckError, match="read_heat_deck"):
        read_deck(deck(tmp_path, BAR + steady(COLD)))
    with pytest.raises(DeckError, match=r"needs \*HEAT TRANSFER, \*STATIC or both coupled"):
        read_heat_deck(deck(tmp_path, BAR + steady(COLD) + "*STEP\n*END STEP\n"))


def test_jobs_write_temperatures_fluxes_and_heat_of_nodes(tmp_path: Path) -> None:
    asked = "*NODE PRINT, NSET=BAR_X1, TOTALS=YES\nNT, RFL\n*EL PRINT, ELSET=BAR\nHFL\n"
    asked += "*NODE FILE\nNT, RFL\n*EL FILE\nHFL\n"
    path = deck(tmp_path, BAR + steady(COLD + "*FILM\n4, F4, 100., 0.3\n" + asked))
    seen: list[Increment] = []
    files = run_job(path, MPI.COMM_SELF, watch=seen.append)
    assert [file.suffix for file in files] == [".frd", ".dat", ".sta", ".cvg"]
    assert [(each.step, each.time) for each in seen] == [(1, 1.0)]
    end, heat = 80.0, 0.3 * (100.0 - 80.0)
    lines = path.with_suffix(".dat").read_text().splitlines()
    start = lines.index(" temperatures for set BAR_X1 and time  0.1000000E+01") + 2
    values = [row.split() for row in lines[start : start + 4]]
    assert [float(value) for _, value in values] == pytest.approx([end] * 4, rel=1e-6)
    start = lines.index(" heat generation for set BAR_X1 and time  0.1000000E+01") + 2
    assert [float(row.split()[1]) for row in lines[start : start + 4]] == pytest.approx(
        [heat / 4] * 4, rel=1e-6
    )
    start = lines.index(" total heat generation for set BAR_X1 and time  0.1000000E+01") + 2
    assert float(lines[start]) == pytest.approx(heat, rel=1e-6)
    start = lines.index(" heat flux (elem, integ.pnt.,qx,qy,qz) for set BAR and time  0.1000000E+01") + 2
    rows = np.array([row.split() for row in lines[start : start + 32]], dtype=float)
    assert rows[:, 0].tolist() == np.repeat([1, 2, 3, 4], 8).tolist()
    assert rows[:, 2:] == pytest.approx(np.tile([-heat, 0.0, 0.0], (32, 1)), abs=1e-6)
    found = read_frd(path.with_suffix(".frd"))
    assert [each.kind for each in found.blocks] == ["NDTEMP", "RFL", "FLUX"]
    last = max(found.nodes)
    assert found.block("NDTEMP").values[last] == pytest.approx([end], rel=1e-5)
    assert found.block("FLUX").values[last] == pytest.approx([-heat, 0.0, 0.0], abs=1e-5)
    assert found.block("RFL").values[last] == pytest.approx([heat / 4], rel=1e-5)


def test_heat_of_nodes_is_conserved_in_curved_cells_and_rings(tmp_path: Path) -> None:
    mesh = mesh_cards({"BAR": quadratic(rectangle((1, 0), (5, 1), (4, 1)))}, element="DCAX8")
    held = "*BOUNDARY\nBAR_X0, 11, , 20.\nBAR_X1, 11, , 60.\n*NODE PRINT, NSET=BAR_X1, TOTALS=ONLY\nRFL\n"
    path = deck(tmp_path, mesh + COPPER + SECTION + steady(held))
    run_job(path, MPI.COMM_SELF)
    total = float(path.with_suffix(".dat").read_text().split()[-1])
    # A sector of two degrees, as CalculiX has it.
    assert total == pytest.approx(2.0 * np.pi * 0.4 * 40.0 / np.log(5.0) / 180.0, rel=1e-3)


GROWING = "*AMPLITUDE, NAME=GROWING\n0., 0., 2., 1.\n"


@pytest.mark.parametrize(
    "mesh", [MESH, mesh_cards({"BAR": quadratic(block((0, 0, 0), (4, 1, 1), (4, 1, 1)))})]
)
def test_increments_of_direct_are_steps_of_euler(tmp_path: Path, mesh: str) -> None:
    # Sources that grow heat an insulated bar: at the ends of four increments they are 1/4, 1/2, 3/4 and 1.
    steps = "*STEP\n*HEAT TRANSFER, DIRECT\n0.5, 2.\n*DFLUX, AMPLITUDE=GROWING\nBAR, BF, 0.2\n*END STEP\n"
    apart = "*NODE\n9999, 9., 9., 9.\n"
    found, (state,) = solved(tmp_path, mesh + apart + COPPER + SECTION + ALL + START + GROWING + steps)
    assert found.initial["BAR"] == pytest.approx(20.0)
    assert state.temperature["BAR"] == pytest.approx(20.0 + 0.2 / 3.6e-3 * 0.5 * 2.5, rel=1e-9)


@pytest.mark.slow
def test_heat_in_time_has_the_error_that_was_asked_for(tmp_path: Path) -> None:
    steps = "*STEP, AMPLITUDE=RAMP\n*HEAT TRANSFER\n0.1, 2.\n*DFLUX\nBAR, BF, 0.2\n*END STEP\n"
    found = read_heat_deck(deck(tmp_path, BAR + ALL + START + steps))
    ((number, time, state),) = found.increments(MPI.COMM_SELF, error=0.5)
    assert (number, time) == (0, 2.0)
    assert state.temperature["BAR"] == pytest.approx(20.0 + 0.2 / 3.6e-3 * 2.0 * 0.5, abs=0.5)


def test_what_changes_in_time_needs_temperatures_at_its_start(tmp_path: Path) -> None:
    with pytest.raises(DeckError, match=r"add \*INITIAL CONDITIONS, TYPE=TEMPERATURE"):
        read_heat_deck(deck(tmp_path, BAR + "*STEP\n*HEAT TRANSFER\n0.5, 2.\n*END STEP\n"))


@pytest.mark.parametrize(
    "steps",
    [
        f"*STEP\n*UNCOUPLED TEMPERATURE-DISPLACEMENT, STEADY STATE\n{CLAMPED}{WARM}*END STEP\n",
        f"*STEP\n*COUPLED TEMPERATURE-DISPLACEMENT, STEADY STATE\n{CLAMPED}{WARM}*END STEP\n",
        steady(WARM) + f"*STEP\n*STATIC\n{CLAMPED}*END STEP\n",
    ],
)
def test_bodies_move_at_the_temperatures_that_were_found(tmp_path: Path, steps: str) -> None:
    asked = "*NODE PRINT, NSET=BAR_X1\nNT, U\n*END STEP\n"
    path = deck(tmp_path, EXPANDS + steps.replace("*END STEP\n", asked))
    seen: list[Increment] = []
    run_job(path, MPI.COMM_SELF, watch=seen.append)
    last = float(steps.count("*STEP"))
    assert [each.time for each in seen] == sorted({1.0, last})
    lines = path.with_suffix(".dat").read_text().splitlines()
    start = lines.index(f" displacements (vx,vy,vz) for set BAR_X1 and time  0.{last:.0f}000000E+01") + 2
    moved = np.array([row.split()[1] for row in lines[start : start + 4]], dtype=float)
    assert moved.mean() == pytest.approx(4.0 * 1e-5 * 20.0, rel=1e-5)
    assert {each.kind for each in read_frd(path.with_suffix(".frd")).blocks} >= {"NDTEMP", "DISP"}
    found = read_heat_deck(path)
    (state,) = found.statics(found.solve(MPI.COMM_SELF)).solve(MPI.COMM_SELF)
    end = found.bodies["BAR"].mesh.points[:, 0] > 4.0 - 1e-9
    assert state.gather_displacement("BAR")[end, 0].mean() == pytest.approx(8e-4, rel=1e-5)


def test_decks_in_which_nothing_moves_have_no_statics(tmp_path: Path) -> None:
    found = read_heat_deck(deck(tmp_path, BAR + steady(COLD)))
    with pytest.raises(InvalidInputError, match="has no step in which bodies move at known"):
        found.statics(found.solve(MPI.COMM_SELF))
