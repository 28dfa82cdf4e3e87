"""Springs, trusses and masses of decks."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest
from mpi4py import MPI

from fenics_contact import read_scene_file
from fenics_contact.decks import DeckError, read_deck, write_scene_file
from fenics_contact.gallery import block
from tests.decks.solved import solved
from tests.decks.texts import FIXED, PLAIN_BAR, STEEL, deck, mesh_cards, step

#: A bar of stiffness E A / L = 210000 / 4, held at x = 0; nodes 17 to 20 are its end.
K = 210000.0 / 4
GROUND = "*NODE, NSET=GROUND\n501, 6., 0., 0.\n502, 4., 0., -3.\n*BOUNDARY\nGROUND, 1, 3\n"
EVEN = "*EQUATION\n2\n18, 1, 1., 17, 1, -1.\n2\n19, 1, 1., 17, 1, -1.\n2\n20, 1, 1., 17, 1, -1.\n"
#: Of a truss of length 2.
AREA = "0.285714285714\n"
PULL = "*CLOAD\n17, 1, 500.\n"
LINE = "*ELEMENT, TYPE=SPRINGA, ELSET=S\n101, 17, 501\n*SPRING, ELSET=S\n\n30000.\n"


def end(folder: Path, cards: str, load: str = PULL) -> float:
    _, _, moved, _ = solved(folder, PLAIN_BAR + GROUND + FIXED + EVEN + cards + step(load))
    return float(moved[17][0])


@pytest.mark.parametrize(
    "cards",
    [
        LINE,
        "*ELEMENT, TYPE=SPRING1, ELSET=S\n101, 17\n102, 19\n*SPRING, ELSET=S\n1\n15000.\n",
        LINE.replace("SPRINGA", "SPRING2").replace("S\n\n", "S\n1, 1\n"),
        LINE.replace("ELSET=S\n\n", "ELSET=S, NONLINEAR\n").replace(
            "30000.", "-3000., -0.1\n0., 0.\n6000., 0.2"
        ),
        "*ELEMENT, TYPE=T3D2, ELSET=S\n101, 17, 501\n*SOLID SECTION, ELSET=S, MATERIAL=STEEL\n" + AREA,
        "*ELEMENT, TYPE=T3D3, ELSET=S\n101, 17, 502, 501\n*SOLID SECTION, ELSET=S, MATERIAL=STEEL\n" + AREA,
    ],
    ids=["SPRINGA", "SPRING1", "SPRING2", "table", "T3D2", "T3D3"],
)
def test_springs_and_trusses_add_their_stiffness(tmp_path: Path, cards: str) -> None:
    """F / (E A / L + k) with k = 30000; that of the trusses is E A / L, too."""
    assert end(tmp_path, cards) == pytest.approx(500.0 / (K + 30000.0), rel=1e-8)


def test_a_spring_between_two_bodies_pulls_both(tmp_path: Path) -> None:
    """Two bars, end to end: the force of a spring of stiffness k in series with both."""
    meshes = {"A": block((0, 0, 0), (1, 1, 1), (1, 1, 1)), "B": block((3, 0, 0), (4, 1, 1), (1, 1, 1))}
    text = mesh_cards(meshes) + STEEL.replace("0.3", "0.")
    text += "".join(f"*SOLID SECTION, ELSET={name}, MATERIAL=STEEL\n" for name in meshes)
    text += "*BOUNDARY\nA_X0, 1, 3\nB_X1, 1, 3\n*ELEMENT, TYPE=SPRINGA, ELSET=S\n101, 5, 9\n102, 6, 10\n"
    text += "*ELSET, ELSET=ALL\nS\n*SPRING, ELSET=ALL\n\n1000.\n"
    _, state, moved, places = solved(tmp_path, text + step("*CLOAD\n9, 1, 10.\n10, 1, 10.\n"))
    assert places[9][0] - places[5][0] == 2.0
    pulled = sum(1000.0 * (moved[k + 4][0] - moved[k][0]) for k in (5, 6))
    assert pulled > 0.01
    assert state.reactions()["A A_X0"].force[0] == pytest.approx(-pulled, rel=1e-7)
    assert state.springs()["ELEMENT 101"].tension[0] == pytest.approx(pulled / 2, rel=1e-7)


def test_a_spring_holds_the_mean_of_nodes(tmp_path: Path) -> None:
    mean = (
        "*NODE\n600, 4., 0., 0.\n*ELEMENT, TYPE=DCOUP3D, ELSET=M\n100, 600\n*DISTRIBUTING COUPLING, ELSET=M\n"
    )
    mean += "17, 1.\n18, 1.\n19, 1.\n20, 1.\n" + LINE.replace("17, 501", "600, 501")
    assert end(tmp_path, mean) == pytest.approx(500.0 / (K + 30000.0), rel=1e-8)


def test_masses_weigh_and_fly(tmp_path: Path) -> None:
    """2 + 2 at x = 4: g = 9 along x, and ω² = 25 about an axis through x = −1."""
    masses = "*ELEMENT, TYPE=MASS, ELSET=M\n101, 17\n102, 20\n*MASS, ELSET=M\n2.\n"
    weight, spin = "*DLOAD\nM, GRAV, 9., 2., 0., 0.\n", "*DLOAD\nM, CENTRIF, 25., -1., 0., 0., 0., 0., 3.\n"
    assert end(tmp_path, masses, weight) == pytest.approx(4.0 * 9.0 / K, rel=1e-8)
    assert end(tmp_path, masses, spin) == pytest.approx(4.0 * 25.0 * 5.0 / K, rel=1e-8)


@pytest.mark.parametrize("kind", ["T3D2", "T3D3"])
def test_half_of_a_truss_weighs_on_each_end(tmp_path: Path, kind: str) -> None:
    """ρ A L g / 2 over E A / L of the bar and of the truss; the held end carries the other half."""
    middle = "502, " if kind == "T3D3" else ""
    truss = f"*ELEMENT, TYPE={kind}, ELSET=S\n101, 17, {middle}501\n*SOLID SECTION, ELSET=S, MATERIAL=STEEL\n"
    weight = 7.85e-9 * 3.0 * 2.0 * 1e10 / 2.0
    cards = (
        truss.replace("MATERIAL=STEEL", "MATERIAL=HEAVY")
        + "3.\n*MATERIAL, NAME=HEAVY\n*ELASTIC\n210000., 0.\n"
    )
    moved = end(tmp_path, cards + "*DENSITY\n7.85e-9\n", "*DLOAD\nS, GRAV, 1e10, 1., 0., 0.\n")
    assert moved == pytest.approx(weight / (K + 210000.0 * 3.0 / 2.0), rel=1e-8)


@pytest.mark.parametrize(
    ("cards", "words"),
    [
        (LINE.replace("*SPRING, ELSET=S\n\n30000.\n", ""), r"element 101 has no \*SPRING or \*SOLID SECTION"),
        (LINE.replace("30000.", "0."), "stiffness of a spring must be above zero, got 0"),
        (LINE.replace("17, 501", "501, 502"), "element 101 joins nodes without elements"),
        (
            LINE.replace("*ELEMENT", "*NODE\n700, 9., 0., 0.\n*ELEMENT").replace("501", "700"),
            "ends at node 700",
        ),
        (
            LINE.replace("S\n\n", "S, NONLINEAR\n").replace("30000.", "0., 0.\n1., 1.\n3., 2."),
            "a line through zero",
        ),
        (LINE.replace("SPRINGA", "SPRING2").replace("S\n\n", "S\n1, 2\n"), "needs one component from 1 to 3"),
        (
            "*ELEMENT, TYPE=T3D2, ELSET=S\n101, 17, 501\n*SOLID SECTION, ELSET=S, MATERIAL=STEEL\n1.\n"
            + step("*DLOAD\nS, GRAV, 9., 1., 0., 0.\n"),
            "the masses of its elements are zero",
        ),
        (
            "*NODE\n700, 0., 0., 9.\n*ELEMENT, TYPE=MASS, ELSET=M\n101, 700\n*MASS, ELSET=M\n2.\n"
            + step("*DLOAD\nM, GRAV, 9., 1., 0., 0.\n"),
            "mass at node 700, of no element and not held: hold it",
        ),
    ],
)
def test_springs_that_cannot_be_are_refused(tmp_path: Path, cards: str, words: str) -> None:
    with pytest.raises(DeckError, match=words):
        read_deck(deck(tmp_path, PLAIN_BAR + GROUND + FIXED + cards + step(PULL)))


def test_a_deck_of_springs_alone_is_refused(tmp_path: Path) -> None:
    alone = (
        "*NODE\n1, 0., 0., 0.\n2, 1., 0., 0.\n" + LINE.replace("17, 501", "1, 2") + step("*CLOAD\n2, 1, 1.\n")
    )
    with pytest.raises(DeckError, match="it has SPRINGA"):
        read_deck(deck(tmp_path, alone))


def test_springs_of_a_deck_are_in_its_scene_file(tmp_path: Path) -> None:
    both = LINE + "*ELEMENT, TYPE=SPRING2, ELSET=Q\n111, 17, 9\n*SPRING, ELSET=Q\n2, 2\n70.\n"
    found, state, _, _ = solved(tmp_path, PLAIN_BAR + GROUND + FIXED + both + step(PULL))
    path, *_ = write_scene_file(found, tmp_path / "again.toml")
    again = read_scene_file(path, MPI.COMM_SELF, overrides=["solver.tolerance=1e-11"]).solve()
    assert list(again.springs()) == ["ELEMENT 101", "ELEMENT 111"]
    one, other = state.gather_displacement("BAR"), again.gather_displacement("BAR")
    np.testing.assert_allclose(one, other, rtol=1e-7, atol=1e-12)
