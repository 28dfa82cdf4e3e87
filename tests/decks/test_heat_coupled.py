"""Decks in which temperatures move bodies, whose pressures, gaps and friction act on temperatures."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np
import pytest
from mpi4py import MPI
from scipy.optimize import brentq

from fenics_contact.decks import DeckError, Increment, read_heat_deck, run_job
from fenics_contact.errors import InvalidInputError
from tests.decks.hot_bars import COPPER, DRY, ENDS, PAIR, TWO, steady
from tests.decks.texts import deck
from tests.frd_files import read_frd

#: Modulus, expansion of the upper bar, and the conductivity of both.
E, EXPANSION, K = 1e5, 1e-5, 0.4
EXPANDING = f"*ELASTIC\n{E}, 0.\n*EXPANSION\n{EXPANSION}\n"
INVAR = COPPER.replace("COPPER", "INVAR") + f"*ELASTIC\n{E}, 0.\n"
MODEL = TWO.replace(COPPER, COPPER + EXPANDING + INVAR).replace("LOW, MATERIAL=COPPER", "LOW, MATERIAL=INVAR")
SETS = "*NSET, NSET=EVERY, ELSET=LOW\n*NSET, NSET=EVERY, ELSET=UP\n*NSET, NSET=ABOVE_ALL, ELSET=UP\n"
COLD = SETS + "*INITIAL CONDITIONS, TYPE=TEMPERATURE\nEVERY, 0.\n"
#: Both bars are straight, and held at their outer ends.
HELD = "*BOUNDARY\nEVERY, 1, 2\nLOW_Z0, 3, 3\nUP_Z1, 3, 3\n"
#: The upper one is pressed on the lower one by 25.
PRESSED = "*BOUNDARY\nEVERY, 1, 2\nLOW_Z0, 3, 3\nUP_Z1, 3, 3, -0.001\n"
HARD = DRY.replace(", PRESSURE-OVERCLOSURE=LINEAR\n1.E6", ", PRESSURE-OVERCLOSURE=HARD")
COUPLED = "*COUPLED TEMPERATURE-DISPLACEMENT"


def model(*of_pair: str) -> str:
    return MODEL + COLD + HARD + "".join(of_pair) + PAIR


def coupled(how: str, cards: str, head: str = "*STEP") -> str:
    return f"{head}\n{COUPLED}{how}\n{cards}*END STEP\n"


def states(folder: Path, text: str) -> list[Any]:
    return [state for _, _, state in read_heat_deck(deck(folder, text)).increments(MPI.COMM_SELF)]


def at_joint(state: Any) -> tuple[float, float]:
    """Temperatures of the lower and of the upper bar at the joint."""
    found = []
    for body in ("LOW", "UP"):
        own = state.temperature[body][np.abs(state.scene.bodies[body].mesh.points[:, 2] - 2.0) < 1e-9]
        assert np.ptp(own) < 1e-6
        found.append(float(own.mean()))
    return found[0], found[1]


@pytest.mark.parametrize("head", ["*STEP", "*STEP, NLGEOM"])
def test_heat_presses_bars_which_conducts_it(tmp_path: Path, head: str) -> None:
    law = "*GAP CONDUCTANCE\n0.02, 0.\n0.42, 40.\n"
    (state,) = states(tmp_path, model(law) + coupled(", STEADY STATE", HELD + ENDS, head))
    low, up = at_joint(state.heat)

    def missing(T: float) -> float:
        """Heat that comes through the upper bar, less what passes to the lower one, which is colder by it."""
        pressure, heat = E * EXPANSION * (T + 100.0) / 4.0, K * (100.0 - T) / 2.0
        return heat - (0.02 + 0.01 * pressure) * (T - 2.0 * heat / K)

    expected = brentq(missing, 50.0, 100.0)
    close = 1e-6 if head == "*STEP" else 2e-3
    assert up == pytest.approx(expected, rel=close)
    assert low == pytest.approx(100.0 - expected, rel=close)
    pressure = state.mechanics.contact.normal_force.sum()
    assert pressure == pytest.approx(E * EXPANSION * (expected + 100.0) / 4.0, rel=close)


def test_increments_are_those_of_heat_where_contact_stays(tmp_path: Path) -> None:
    law = "*GAP CONDUCTANCE\n0.1\n"
    both = deck(tmp_path, model(law) + coupled(", DIRECT\n0.5, 2.", PRESSED + ENDS))
    seen: list[Increment] = []
    files = run_job(both, MPI.COMM_SELF, watch=seen.append)
    assert [each.step_time for each in seen] == pytest.approx([0.5, 1.0, 1.5, 2.0])
    assert all(each.contacts for each in seen)
    kinds = [each.kind for each in read_frd(files[0]).blocks]
    assert kinds == ["NDTEMP", "FLUX", "DISP", "STRESS"] * 4
    states_of_both = states(tmp_path, both.read_text())
    alone = read_heat_deck(
        deck(tmp_path, model(law) + f"*STEP\n*HEAT TRANSFER, DIRECT\n0.5, 2.\n{ENDS}*END STEP\n")
    )
    (expected,) = alone.solve(MPI.COMM_SELF)
    assert at_joint(states_of_both[-1].heat) == pytest.approx(at_joint(expected), rel=1e-8)
    assert states_of_both[-1].mechanics.contact.normal_force.sum() > 25.0, "the upper bar is warmer"


def test_increments_grow_by_half_and_end_where_amplitudes_turn(tmp_path: Path) -> None:
    turning = "*AMPLITUDE, NAME=TURNING\n0., 0., 0.7, 1., 2., 1.\n"
    warm = ENDS.replace("*BOUNDARY", "*BOUNDARY, AMPLITUDE=TURNING")
    text = turning + model("*GAP CONDUCTANCE\n0.1\n") + coupled("\n0.1, 1., 0., 0.3", HELD + warm)
    found = read_heat_deck(deck(tmp_path, text))
    times = [time for _, time, _ in found.increments(MPI.COMM_SELF)]
    assert times == pytest.approx([0.1, 0.25, 0.475, 0.7, 0.775, 1.0])


def test_steps_go_on_from_each_other(tmp_path: Path) -> None:
    law, ends = "*GAP CONDUCTANCE\n0.1\n", PRESSED + ENDS
    twice = coupled(", DIRECT\n0.5, 1.", ends) + coupled(", DIRECT\n0.5, 1.", ends)
    once = coupled(", DIRECT\n0.5, 2.", ends, "*STEP, AMPLITUDE=STEP")
    two, one = (states(tmp_path, model(law) + text) for text in (twice, once))
    assert len(two) == len(one) == 4
    assert at_joint(two[-1].heat) == pytest.approx(at_joint(one[-1].heat), rel=1e-7)


RUBS = "*FRICTION\n0.3, 1.E9\n*GAP HEAT GENERATION\n{}\n"


def test_friction_heats_both_surfaces_by_a_speed_that_is_given(tmp_path: Path) -> None:
    ends = "*BOUNDARY\nLOW_Z0, 11, 11, 0.\nUP_Z1, 11, 11, 0.\n"
    text = model(RUBS.format("0.9, 0.2, 0.01")).replace(f"*EXPANSION\n{EXPANSION}\n", "")
    (state,) = states(tmp_path, text + coupled(", STEADY STATE", PRESSED + ends))
    heat = 0.9 * 0.3 * 25.0 * 0.01
    assert at_joint(state.heat) == pytest.approx((0.8 * heat * 2.0 / K, 0.2 * heat * 2.0 / K), rel=1e-6)


@pytest.mark.parametrize("line", ["0.9, 0.2", "0.9, 0.2, -1."])
def test_friction_heats_by_the_slip_of_the_bodies(tmp_path: Path, line: str) -> None:
    ends = "*BOUNDARY\nLOW_Z0, 11, 11, 0.\nUP_Z1, 11, 11, 0.\n"
    slides = PRESSED + "*BOUNDARY\nABOVE_ALL, 1, 1, 0.02\n"
    text = model(RUBS.format(line)).replace(f"*EXPANSION\n{EXPANSION}\n", "")
    (state,) = states(tmp_path, text + coupled(", DIRECT\n2., 2.", slides + ends))
    (heat,) = (value for name, value in state.heat.balance.by_part.items() if name.startswith("Friction"))
    assert heat == pytest.approx(0.9 * 0.3 * 25.0 * 0.02 / 2.0, rel=1e-6)
    assert state.heat.balance.error < 1e-10


COUPLED_STEP = coupled(", STEADY STATE", HELD + ENDS)
REFUSED = {
    "a static step before it": (
        model("*GAP CONDUCTANCE\n0.1\n") + f"*STEP\n*STATIC\n{HELD}*END STEP\n" + COUPLED_STEP,
        r"\*STATIC: does not go with contact that acts on heat: give coupled steps alone",
    ),
    "heat alone before it": (
        model("*GAP CONDUCTANCE\n0.1\n") + steady(ENDS) + COUPLED_STEP,
        r"\*HEAT TRANSFER: does not go with contact that acts on heat",
    ),
    "pairs that come and go": (
        model("*GAP CONDUCTANCE\n0.1\n")
        + COUPLED_STEP
        + coupled("", "*MODEL CHANGE, TYPE=CONTACT PAIR, REMOVE\nABOVE, BELOW\n"),
        r"\*MODEL CHANGE: does not go with contact that acts on heat",
    ),
    "a cut": (
        "*SURFACE, NAME=CUT\n1, S2\n*NODE\n9999, 9., 9., 9.\n*PRE-TENSION SECTION, SURFACE=CUT, NODE=9999\n"
        + model("*GAP CONDUCTANCE\n0.1\n")
        + COUPLED_STEP,
        r"\*PRE-TENSION SECTION: does not go with contact that acts on heat",
    ),
    "no friction": (
        model("*GAP HEAT GENERATION\n0.9, 0.2, 1.\n") + COUPLED_STEP,
        r"\*GAP HEAT GENERATION: needs the \*FRICTION of its interaction",
    ),
    "a share above one": (
        model(RUBS.format("0.9, 1.2, 1.")) + COUPLED_STEP,
        "share must lie between 0 and 1, got 1.2.*its line has the part, the share and a speed",
    ),
    "a routine": (
        model("*FRICTION\n0.3\n*GAP HEAT GENERATION, USER\n") + COUPLED_STEP,
        r"\*GAP HEAT GENERATION: the parameter USER is not read",
    ),
}  # fmt: skip


@pytest.mark.parametrize("kind", REFUSED)
def test_what_does_not_go_with_both_is_refused_by_name(tmp_path: Path, kind: str) -> None:
    text, words = REFUSED[kind]
    with pytest.raises(DeckError, match=words):
        read_heat_deck(deck(tmp_path, text))


def test_bodies_begin_with_one_temperature_each(tmp_path: Path) -> None:
    text = model("*GAP CONDUCTANCE\n0.1\n").replace("EVERY, 0.\n", "EVERY, 0.\nUP_Z1, 5.\n")
    found = read_heat_deck(deck(tmp_path, text + COUPLED_STEP))
    with pytest.raises(InvalidInputError, match="must have one initial temperature each, UP has 0 to 5"):
        found.solve(MPI.COMM_SELF)


def test_uncoupled_steps_with_such_contact_agree_too_and_notes_say_so(tmp_path: Path) -> None:
    text = model("*GAP CONDUCTANCE\n0.02, 0.\n0.42, 40.\n") + COUPLED_STEP
    found = read_heat_deck(deck(tmp_path, text.replace("*COUPLED", "*UNCOUPLED")))
    assert any("contact acts on heat, both are solved until they agree" in note for note in found.notes)
    (state,) = found.solve(MPI.COMM_SELF)
    assert at_joint(state.heat) == pytest.approx(at_joint(states(tmp_path, text)[0].heat))
    with pytest.raises(InvalidInputError, match="no step in which bodies move at known temperatures"):
        found.statics([state])
