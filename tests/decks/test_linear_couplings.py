"""Couplings of some components, along local axes and of nodes of elements; equations of nodes without any."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

from fenics_contact.decks import DeckError, read_deck
from tests.decks.columns import COLUMNS, HELD, SOFT
from tests.decks.columns import SECTION as OF
from tests.decks.solved import solved
from tests.decks.texts import FIXED, KINEMATIC, PLAIN_BAR, REFERENCE, RIGID, SPREAD, deck, mesh_cards, step

BAR = PLAIN_BAR + REFERENCE
ONE = KINEMATIC.replace("1, 6", "1, 1")
ENDS = [17, 18, 19, 20]


def ends(moved: dict[int, np.ndarray]) -> np.ndarray:
    return np.array([moved[k] for k in ENDS])


def test_one_component_of_a_surface_follows_a_node(tmp_path: Path) -> None:
    """F L / (E A) = 210 · 4 / 210000 for all of the end, which contracts as it likes."""
    load = step("*BOUNDARY\n501, 4, 6\n*CLOAD\n501, 1, 210.\n17, 2, 3.\n")
    _, state, moved, _ = solved(tmp_path, BAR + FIXED + ONE + load)
    np.testing.assert_allclose(ends(moved)[:, 0], 4e-3, rtol=1e-8)
    assert np.ptp(ends(moved)[:, 1]) > 1e-8
    np.testing.assert_allclose(state.reactions()["BAR BAR_X0"].force, [-210.0, -3.0, 0.0], atol=1e-7)


def test_the_moment_of_a_force_on_a_node_reaches_the_surface(tmp_path: Path) -> None:
    """A node 2 above the middle of the end, free to turn: F at an arm of 2, and a moment of its own."""
    high = BAR.replace("501, 4., 0.5, 0.5", "501, 4., 2.5, 0.5")
    load = step("*CLOAD\n501, 1, 210.\n501, 6, 50.\n")
    _, state, moved, _ = solved(tmp_path, high + FIXED + ONE + load)
    root = state.reactions(about=(0.0, 0.5, 0.5))["BAR BAR_X0"]
    np.testing.assert_allclose(root.force, [-210.0, 0.0, 0.0], atol=1e-7)
    np.testing.assert_allclose(root.moment, [0.0, 0.0, 420.0 - 50.0], atol=1e-6)
    flat = np.column_stack([np.ones(4), [[0, 0], [1, 0], [0, 1], [1, 1]]])
    left = ends(moved)[:, 0] - flat @ np.linalg.lstsq(flat, ends(moved)[:, 0], rcond=None)[0]
    np.testing.assert_allclose(left, 0.0, atol=1e-12)


def test_the_tangential_component_alone_twists(tmp_path: Path) -> None:
    """CalculiX 2.20 has 5e-3 along y and z at the corners, free along the bar, for 0.01 about it."""
    axes = "*ORIENTATION, NAME=O, SYSTEM=CYLINDRICAL\n0., 0.5, 0.5, 1., 0.5, 0.5\n"
    twist = KINEMATIC.replace("1, 6", "2").replace("COUPLING,", "COUPLING, ORIENTATION=O,")
    _, state, moved, places = solved(
        tmp_path, BAR + FIXED + axes + twist + step("*BOUNDARY\n501, 4, 4, 0.01\n")
    )
    arms = np.array([places[k] for k in ENDS]) - [4.0, 0.5, 0.5]
    turned = np.cross([0.01, 0.0, 0.0], arms)
    np.testing.assert_allclose(ends(moved)[:, 1:], turned[:, 1:], atol=1e-9)
    moment = state.reactions(about=(0.0, 0.5, 0.5))["BAR BAR_X0"].moment
    assert moment[0] < -10.0
    np.testing.assert_allclose(moment[1:], 0.0, atol=1e-6 * abs(moment[0]))


def test_a_rigid_body_that_only_turns_moves_as_it_likes(tmp_path: Path) -> None:
    turned = RIGID.replace("REF NODE=501, ", "")
    load = step("*BOUNDARY\n502, 1, 1, 0.01\n502, 2, 3\n*CLOAD\n17, 1, 210.\n")
    _, _, moved, _ = solved(tmp_path, BAR + FIXED + turned + load)
    _, _, other, _ = solved(tmp_path, BAR + FIXED + RIGID + load)
    np.testing.assert_allclose(ends(moved), ends(other), rtol=1e-9, atol=1e-14)
    np.testing.assert_allclose(ends(moved)[:, 0], 4e-3, rtol=1e-8)
    assert np.ptp(ends(moved)[:, 1]) == pytest.approx(0.01, rel=1e-8)


def test_a_distributing_coupling_takes_forces_along_its_axes(tmp_path: Path) -> None:
    axes = "*ORIENTATION, NAME=O\n0., 1., 0., 0., 0., 1.\n"
    local = SPREAD.replace("COUPLING,", "COUPLING, ORIENTATION=O,")
    _, state, _, _ = solved(
        tmp_path, BAR + FIXED + axes + local + step("*CLOAD\n501, 3, 210.\n501, 1, 7.\n501, 6, 5.\n")
    )
    root = state.reactions(about=(4.0, 0.5, 0.5))["BAR BAR_X0"]
    np.testing.assert_allclose(root.force, [-210.0, -7.0, 0.0], atol=1e-7)
    np.testing.assert_allclose(root.moment, [-5.0, 0.0, 0.0], atol=1e-6)


def test_forces_along_the_axis_of_a_sector_are_spread_evenly(tmp_path: Path) -> None:
    """As CalculiX has it with CYCLIC SYMMETRY: the arm from the axis counts for the whole ring alone."""
    high = BAR.replace("501, 4., 0.5, 0.5", "501, 4., 2.5, 0.5")
    sector = SPREAD.replace("*DISTRIBUTING", "*DISTRIBUTING, CYCLIC SYMMETRY")
    for cards, moment in ((SPREAD, 420.0), (sector, 0.0)):
        _, state, _, _ = solved(tmp_path, high + FIXED + cards + step("*CLOAD\n501, 1, 210.\n"))
        root = state.reactions(about=(0.0, 0.5, 0.5))["BAR BAR_X0"]
        np.testing.assert_allclose(root.moment, [0.0, 0.0, moment], atol=1e-6)


def test_forces_on_nodes_without_elements_go_where_equations_say(tmp_path: Path) -> None:
    """u_501 = (u_17 + 3 u_18) / 4 and u_502 = 2 u_501: 8 on 502 is 4 on 17 and 12 on 18."""
    joined = "*EQUATION\n3\n501, 1, -4., 17, 1, 1., 18, 1, 3.\n2\n502, 1, 1., 501, 1, -2.\n"
    _, _, moved, _ = solved(tmp_path, BAR + FIXED + joined + step("*CLOAD\n502, 1, 8.\n"))
    _, _, other, _ = solved(tmp_path, BAR + FIXED + step("*CLOAD\n17, 1, 4.\n18, 1, 12.\n"))
    np.testing.assert_allclose(ends(moved), ends(other), rtol=1e-8, atol=1e-15)
    assert abs(ends(moved)).max() > 1e-5


def test_an_equation_of_a_set_is_one_for_each_of_its_nodes(tmp_path: Path) -> None:
    """As CalculiX has it: the first term is a set of nodes, which 18 is one of."""
    even = "*EQUATION\n2\nBAR_X1, 1, 1., 18, 1, -1.\n"
    _, _, moved, _ = solved(tmp_path, BAR + FIXED + even + step("*CLOAD\n17, 1, 210.\n"))
    np.testing.assert_allclose(ends(moved)[:, 0], ends(moved)[0, 0], rtol=1e-9)
    assert abs(ends(moved)[0, 0]) > 1e-4


def test_a_node_of_an_element_drives_a_surface_of_another_body(tmp_path: Path) -> None:
    """Node 14, a corner of B's top, is the reference of A's top, with its force: both resist it."""
    text = mesh_cards(COLUMNS) + SOFT + OF.format("A") + OF.format("B") + HELD
    text += "*NODE\n21, 5., 5., 5.\n*RIGID BODY, NSET=A_Z1, REF NODE=14, ROT NODE=21\n*BOUNDARY\n21, 1, 3\n"
    found, state, moved, places = solved(tmp_path, text + step("*CLOAD\n14, 3, -3.\n"))
    assert places[14][2] == 1.0
    assert places[14][0] >= 3.0
    tops = [k for k, place in places.items() if place[2] == 1.0 and place[0] < 2.0]
    np.testing.assert_allclose([moved[k][2] for k in tops], moved[14][2], rtol=1e-8)
    forces = state.reactions()
    assert forces["A A_Z0"].force[2] == pytest.approx(-1000.0 * moved[14][2], rel=1e-7)
    assert forces["A A_Z0"].force[2] + forces["B B_Z0"].force[2] == pytest.approx(3.0, rel=1e-8)
    with pytest.raises(DeckError, match=r"node 14 is also of an element or equation"):
        read_deck(deck(tmp_path, text + step("*CLOAD\n14, 3, -3.\n", ", NLGEOM")))
    assert found.scene.constraints


@pytest.mark.parametrize(
    ("cards", "words"),
    [
        (
            "*EQUATION\n2\n501, 1, 1., 17, 1, -1.\n*STEP\n*STATIC\n*BOUNDARY\n501, 1\n*END STEP\n",
            "in some steps alone",
        ),
        (
            "*EQUATION\n3\n501, 1, 1., 502, 1, 1., 17, 1, -1.\n",
            r"component 1 of node 501 has a \*CLOAD, but no",
        ),
    ],
)
def test_components_without_elements_must_be_determined(tmp_path: Path, cards: str, words: str) -> None:
    with pytest.raises(DeckError, match=words):
        read_deck(
            deck(
                tmp_path, BAR + FIXED + cards + step("*BOUNDARY, OP=NEW\nBAR_X0, 1, 3\n*CLOAD\n501, 1, 1.\n")
            )
        )


def test_some_components_alone_are_not_for_large_deformations(tmp_path: Path) -> None:
    with pytest.raises(DeckError, match="some of components 1 to 3 alone are not supported with NLGEOM"):
        read_deck(deck(tmp_path, BAR + FIXED + ONE + step("*CLOAD\n501, 1, 1.\n", ", NLGEOM")))
