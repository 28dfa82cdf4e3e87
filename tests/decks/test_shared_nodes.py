"""Several cards with one node: surfaces that it drives are one rigid piece, and its force acts once."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest
from mpi4py import MPI

from fenics_contact.decks import Deck, DeckError, read_deck
from fenics_contact.gallery import rectangle
from tests.decks.columns import BOTH, COUPLED, DOWN, ON_A, RIGID, SECTION, SOFT, UPRIGHT, columns
from tests.decks.texts import deck, mesh_cards, step


def moved(text: str, folder: Path) -> tuple[Deck, dict[int, np.ndarray]]:
    """Return the displacements of nodes by their numbers."""
    found = read_deck(deck(folder, text))
    (state,) = found.solve(MPI.COMM_SELF, tolerance=1e-10)
    return found, {
        number: vector
        for name in found.scene.bodies
        for number, vector in zip(found.node_numbers[name].tolist(), state.gather_displacement(name))
    }


@pytest.mark.parametrize("load", [DOWN, ON_A], ids=["on the node", "on one column"])
def test_rigid_bodies_of_one_node_share_its_force(load: str, tmp_path: Path) -> None:
    """Two columns of E A / L = 1000 under a force of 3 that must not turn: both go down by 0.0015."""
    _, by_number = moved(columns(BOTH, UPRIGHT, load), tmp_path)
    tops = [number for number, place in by_number.items() if abs(place[2]) > 1e-12]
    assert len(tops) == 8
    np.testing.assert_allclose([by_number[k][2] for k in tops], -0.0015, rtol=1e-8)


#: Displacements of corners under a force that lets both tops turn, as CalculiX 2.20 prints them.
TURNED = {
    DOWN: {(0, 0): (-6.315789e-4, -3e-3, -7.026316e-3), (4, 1): (-6.315789e-4, -3e-3, 4.026316e-3)},
    ON_A: {(0, 0): (-4.736842e-4, 0.0, -3.394737e-3), (4, 1): (-4.736842e-4, 0.0, 3.947368e-4)},
}


@pytest.mark.parametrize("load", TURNED, ids=["on the node", "on one column"])
@pytest.mark.parametrize("cards", [BOTH, COUPLED], ids=["rigid bodies", "couplings"])
def test_surfaces_of_one_node_turn_as_one_piece(cards: str, load: str, tmp_path: Path) -> None:
    found, by_number = moved(columns(cards, "", load), tmp_path)
    corners = found.mesh.mesh
    for (x, y), expected in TURNED[load].items():
        (place,) = np.flatnonzero((corners.points == [x, y, 1.0]).all(axis=1) & (corners.numbers < 21))
        np.testing.assert_allclose(by_number[int(corners.numbers[place])], expected, rtol=1e-6, atol=1e-9)
    assert any("turn as one piece" in note for note in found.notes) == (cards is COUPLED)


def test_one_rigid_body_of_nodes_of_two_bodies_is_one_piece(tmp_path: Path) -> None:
    both = "*NSET, NSET=TOPS\nA_Z1, B_Z1\n" + RIGID.format("TOPS")
    _, one = moved(columns(both, "", DOWN), tmp_path)
    _, two = moved(columns(BOTH, "", DOWN), tmp_path)
    np.testing.assert_allclose(np.array(list(one.values())), np.array(list(two.values())), atol=1e-12)
    assert max(np.abs(v).max() for v in one.values()) > 1e-3


def test_surfaces_of_one_node_stay_one_piece_where_they_turn_far(tmp_path: Path) -> None:
    """Distances between all nodes of both tops stay, far beyond what small turns keep."""
    found, by_number = moved(columns(BOTH, "", DOWN.replace("-3.", "-100."), ", NLGEOM"), tmp_path)
    mesh = found.mesh.mesh
    tops = np.flatnonzero((mesh.points[:, 2] == 1.0) & (mesh.numbers < 21))
    points = mesh.points[tops]
    now = points + np.array([by_number[number] for number in mesh.numbers[tops].tolist()])

    def apart(places: np.ndarray) -> np.ndarray:
        return np.linalg.norm(places[:, None] - places, axis=2)

    np.testing.assert_allclose(apart(now), apart(points), rtol=1e-7)
    edge = now[np.argmax(points[:, 0])] - now[np.argmin(points[:, 0])]
    assert abs(edge[2]) > 0.04 * np.linalg.norm(edge)


def test_forces_of_nodes_that_drive_plane_bodies_are_per_thickness(tmp_path: Path) -> None:
    """A plate of 2 × 1, thickness 0.1, pulled by 10: the stress is 100, and it is longer by 2 · 100 / E."""
    text = mesh_cards({"A": rectangle((0, 0), (2, 1), (2, 1))}, "CPS4") + SOFT + SECTION.format("A") + "0.1\n"
    text += "*NODE\n21, 2., 0.5\n*RIGID BODY, NSET=A_X1, REF NODE=21, ROT NODE=21\n"
    text = text.replace(", ROT NODE=21", "") + "*BOUNDARY\nA_X0, 1, 2\n"
    _, by_number = moved(text + step("*CLOAD\n21, 1, 10.\n"), tmp_path)
    assert max(vector[0] for vector in by_number.values()) == pytest.approx(0.2, rel=1e-8)


@pytest.mark.parametrize("kind", ["CPS4", "CPE4"])
@pytest.mark.parametrize("thickness", [0.1, 0.5, 1.0])
def test_bolts_of_plane_bodies_have_their_force_over_the_thickness(
    kind: str, thickness: float, tmp_path: Path
) -> None:
    """Between walls a force F on the section t w gives the stress F / (t w)."""
    text = mesh_cards({"A": rectangle((0, 0), (2, 1), (2, 1))}, kind) + SOFT + SECTION.format("A")
    text += f"{thickness}\n*NODE\n21, 5., 5.\n*SURFACE, NAME=CUT\n1, S2\n"
    text += "*PRE-TENSION SECTION, SURFACE=CUT, NODE=21\n1., 0.\n"
    text += "*BOUNDARY\nA_X0, 1, 2\nA_X1, 1, 2\n"
    found = read_deck(deck(tmp_path, text + step("*CLOAD\n21, 1, 10.\n")))
    (state,) = found.solve(MPI.COMM_SELF, tolerance=1e-10)
    np.testing.assert_allclose(state.gather_stress("A")[:, 0, 0], 10.0 / thickness, rtol=1e-8)


WRONG = [
    (
        RIGID.format("A_Z1") + "*RIGID BODY, NSET=B_Z1, REF NODE=21\n",
        r"must share REF NODE and ROT NODE with 'A_Z1'",
    ),
    (
        RIGID.format("A_Z1") + RIGID.format("B_Z1").replace("=21", "=23"),
        r"must share REF NODE and ROT NODE with 'A_Z1'",
    ),
    (
        COUPLED.replace("*KINEMATIC\n1, 3\n*SURFACE", "*DISTRIBUTING\n*SURFACE"),
        r"node 21 of a distributing coupling is also of 'CA'",
    ),
    (
        "*SURFACE, NAME=CA\n1, S1\n*SURFACE, NAME=CB\n2, S1\n" + "".join(
            f"*PRE-TENSION SECTION, SURFACE=C{name}, NODE=21\n" for name in "AB"
        ),
        r"\*PRE-TENSION SECTION: node 21 is used by a card before",
    ),
]  # fmt: skip


@pytest.mark.parametrize(("cards", "message"), WRONG, ids=[w[1][:30] for w in WRONG])
def test_nodes_that_cannot_be_shared_are_named(cards: str, message: str, tmp_path: Path) -> None:
    text = columns(cards, "", DOWN).replace("22, 0., 0., 1.\n", "22, 0., 0., 1.\n23, 0., 0., 1.\n")
    with pytest.raises(DeckError, match=message):
        read_deck(deck(tmp_path, text))
