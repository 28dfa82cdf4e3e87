"""Decks whose constants depend on the temperature."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest
from mpi4py import MPI

from fenics_contact import ThermalStrain, read_scene_file
from fenics_contact._scene.fields import NodeValues
from fenics_contact.decks import DeckError, read_deck, write_scene_file
from fenics_contact.gallery import block, rectangle
from fenics_contact.materials import TemperatureDependentElasticity
from fenics_contact.mesh import quadratic
from tests.decks.texts import BAR, END, FREE_TO_CONTRACT, SECTION, deck, mesh_cards, step

SOFTENING = "*ELASTIC\n100000., 0., 520.\n200000., 0., 20.\n"
WIDENING = "*EXPANSION, ZERO=10.\n1.E-5, 20.\n2.E-5, 520.\n"
INITIAL = "*NSET, NSET=ALL, GENERATE\n1, 24\n*INITIAL CONDITIONS, TYPE=TEMPERATURE\nALL, 120.\n"


def heated(cards: str, steps: str, text: str = BAR) -> str:
    """Return a deck whose material has other cards."""
    return text.replace("*ELASTIC\n210000., 0.3\n", cards) + FREE_TO_CONTRACT + INITIAL + steps


def test_stiffness_and_expansion_follow_the_temperature_of_each_step(tmp_path: Path) -> None:
    """α(T) (T − 10) − α(120) (120 − 10) and E(T), by hand: at 220 °C 1.6e5, at 420 °C 1.2e5."""
    pulled = "*DLOAD\nEND, P4, -60.\n"
    steps = step(pulled + "*TEMPERATURE\nALL, 220.\n") + step("*TEMPERATURE\nALL, 420.\n")
    found = read_deck(deck(tmp_path, heated(SOFTENING + WIDENING, steps, BAR + END)))
    (material,) = found.scene.bodies["BAR"].materials
    assert material == TemperatureDependentElasticity(
        ((20.0, 2e5), (520.0, 1e5)), 0.0, ((20.0, 1e-5), (520.0, 2e-5)), 120.0, 10.0
    )
    before = 1.2e-5 * 110.0
    wanted = [3 * (60.0 / 1.6e5 + 1.4e-5 * 210 - before), 3 * (60.0 / 1.2e5 + 1.8e-5 * 410 - before)]
    states = found.solve(MPI.COMM_SELF, tolerance=1e-11)
    tips = [state.gather_displacement("BAR")[:, 0] for state in states]
    np.testing.assert_allclose([tip.max() for tip in tips], wanted, rtol=1e-7)
    path, *_ = write_scene_file(found, tmp_path / "again.toml")
    again = read_scene_file(path, MPI.COMM_SELF, overrides=["solver.tolerance=1e-10"]).solve()
    np.testing.assert_allclose(again.gather_displacement("BAR")[:, 0], tips[1], atol=1e-9)


def test_a_temperature_that_never_changes_needs_no_table(tmp_path: Path) -> None:
    found = read_deck(deck(tmp_path, heated(SOFTENING, step(""))))
    (material,) = found.scene.bodies["BAR"].materials
    assert getattr(material, "young_modulus", 0.0) == pytest.approx(1.8e5)
    assert not isinstance(material, TemperatureDependentElasticity)


def test_centres_of_quadratic_cells_have_the_temperatures_around_them(tmp_path: Path) -> None:
    """Temperatures 20 + 100 x at the nodes of the deck, which has no centres of faces and cells."""
    mesh = quadratic(block((0, 0, 0), (2, 1, 1), (2, 1, 1)))
    text = mesh_cards({"BAR": mesh}) + "*MATERIAL, NAME=STEEL\n*ELASTIC\n210000., 0.3\n*EXPANSION\n1.E-5\n"
    nodes = [line.split(",") for line in text.partition("*ELEMENT")[0].splitlines()[1:]]
    initial = [f"{int(number)}, 20." for number, *_ in nodes]
    now = [f"{int(number)}, {20.0 + 100.0 * float(x)}" for number, x, *_ in nodes]
    text += SECTION + "*INITIAL CONDITIONS, TYPE=TEMPERATURE\n" + "\n".join(initial) + "\n"
    text += "*BOUNDARY\nBAR_X0, 1, 3\n" + step("*TEMPERATURE\n" + "\n".join(now) + "\n")
    found = read_deck(deck(tmp_path, text))
    (heat,) = (load for load in found.steps[0].loads if isinstance(load, ThermalStrain))
    body = found.scene.bodies["BAR"].mesh
    assert body.centres
    assert isinstance(heat.value, NodeValues)
    np.testing.assert_allclose(heat.value.values, 100.0 * body.points[:, 0], atol=1e-10)


PLATE = mesh_cards({"BAR": rectangle((0, 0), (3, 4), (3, 5))}, "CPS4")
PLATE += "*MATERIAL, NAME=STEEL\n*ELASTIC\n210000., 0.3\n" + SECTION
HOT = step("*TEMPERATURE\nALL, 220.\n")


@pytest.mark.parametrize(
    ("text", "message"),
    [
        (
            heated(SOFTENING, HOT, PLATE).replace("BAR_Z0, 3\n", ""),
            r"must not depend on the temperature",
        ),
        (heated(SOFTENING, HOT.replace("STEP", "STEP, NLGEOM", 1)), r"must not depend on the temperature"),
        (heated(SOFTENING + "*PLASTIC\n300., 0.\n", HOT), r"must not depend on the temperature"),
        (
            heated(SOFTENING, HOT).replace("ALL, 120.\n", "ALL, 120.\nBAR_X0, 20.\n"),
            r"depend on the temperature are not supported with several initial temperatures",
        ),
        (heated(SOFTENING.replace("520.", "20."), HOT), r"or pairs with ascending temperatures"),
    ],
    ids=["plane stress", "large", "metal", "initial", "twice"],
)  # fmt: skip
def test_what_cannot_follow_the_temperature_is_refused(text: str, message: str, tmp_path: Path) -> None:
    with pytest.raises(DeckError, match=message):
        read_deck(deck(tmp_path, text))


def test_temperatures_may_be_linear_between_planes(tmp_path: Path) -> None:
    """100, 200, 300 and 100 at the nodes along the bar, whose cells end there."""
    lines = "*TEMPERATURE, LINTEMP\n1., 0., 0., 0., 100., 2., 300.\n1., 0., 0., 2., 300., 3., 100.\n"
    text = BAR.replace("0.3\n", "0.\n*EXPANSION\n1.E-5\n") + FREE_TO_CONTRACT
    found = read_deck(deck(tmp_path, text + step(lines)))
    (heat,) = found.steps[0].loads
    assert isinstance(heat, ThermalStrain)
    assert isinstance(heat.temperature_change, NodeValues)
    along = heat.temperature_change.points[:, 0]
    wanted = np.array([100.0, 200.0, 300.0, 100.0])[along.astype(int)]
    np.testing.assert_allclose(heat.temperature_change.values, wanted)
    assert set(along) == {0.0, 1.0, 2.0, 3.0}
    with pytest.raises(DeckError, match="needs a normal and two planes"):
        read_deck(deck(tmp_path, text + step(lines.replace(", 3., 100.", ", 2., 100."))))
