"""Rigid bodies, couplings, bolts, local axes and equations of decks, as in theory."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest
from mpi4py import MPI

from fenics_contact import LinearConstraint, RigidSurface, Roller, Support, TotalForce
from fenics_contact.decks import DeckError, read_deck
from fenics_contact.gallery import block, rectangle
from tests.decks.texts import (
    FIXED,
    KINEMATIC,
    REFERENCE,
    RIGID,
    SECTION,
    SPREAD,
    STEEL,
    deck,
    mesh_cards,
    step,
)
from tests.decks.texts import PLAIN_BAR as BAR


@pytest.mark.parametrize("coupling", [RIGID, KINEMATIC])
def test_a_node_pulls_a_surface_that_stays_rigid(coupling: str, tmp_path: Path) -> None:
    text = BAR + REFERENCE + coupling + FIXED + step("*BOUNDARY\n501, 1, 1, 0.004\n501, 2, 3\n")
    found = read_deck(deck(tmp_path, text))
    (rigid,) = (each for each in found.steps[0].supports if isinstance(each, RigidSurface))
    assert rigid.displacement == (0.004, 0.0, 0.0)
    assert rigid.rotation == (None, None, None)
    (state,) = found.solve(MPI.COMM_SELF, tolerance=1e-10)
    exact = found.scene.bodies["BAR"].mesh.points * [1e-3, 0.0, 0.0]
    np.testing.assert_allclose(state.gather_displacement("BAR"), exact, atol=1e-9)
    assert state.reactions()["BAR BAR_X0"].force[0] == pytest.approx(-210.0, rel=1e-6)


def test_a_node_turns_and_loads_a_rigid_surface(tmp_path: Path) -> None:
    """Forces and moments of the reference node balance the reactions, also by a node of rotations."""
    by_rotation_node = RIGID + FIXED + step("*CLOAD\n501, 2, 3.\n502, 1, 7.\n")
    by_reference = KINEMATIC + FIXED + step("*CLOAD\n501, 2, 3.\n501, 4, 7.\n")
    spread = SPREAD + FIXED + step("*CLOAD\n501, 2, 3.\n501, 4, 7.\n")
    for cards in (by_rotation_node, by_reference, spread):
        found = read_deck(deck(tmp_path, BAR + REFERENCE + cards))
        (state,) = found.solve(MPI.COMM_SELF, tolerance=1e-10)
        root = state.reactions(about=(4.0, 0.5, 0.5))["BAR BAR_X0"]
        np.testing.assert_allclose(root.force, [0.0, -3.0, 0.0], atol=1e-5)
        assert root.moment[0] == pytest.approx(-7.0, rel=1e-5)
    assert isinstance(found.steps[0].loads[0], TotalForce)


def test_a_bolt_is_drawn_by_a_force_and_held_then(tmp_path: Path) -> None:
    """A bar between two walls: the section gets its force; held, it adds the strain of a wall that moves."""
    bolt = "*NODE\n900, 0., 0., 0.\n*SURFACE, NAME=CUT\n2, S4\n"
    bolt += "*PRE-TENSION SECTION, SURFACE=CUT, NODE=900\n1., 0., 0.\n"
    steps = step("*CLOAD\n900, 1, 420.\n") + step(
        "*BOUNDARY, FIXED\n900, 1, 1\n*BOUNDARY\nBAR_X1, 1, 1, 0.004\n"
    )
    text = BAR + bolt + FIXED + "BAR_X1, 1, 3\n" + steps
    found = read_deck(deck(tmp_path, text))
    first, second = found.solve(MPI.COMM_SELF, tolerance=1e-10)
    assert first.reactions()["BAR BAR_X0"].force[0] == pytest.approx(-420.0, rel=1e-6)
    assert first.preloads()["CUT"].force == pytest.approx(420.0, rel=1e-6)
    assert first.preloads()["CUT"].shortening == pytest.approx(420.0 * 4 / 210000.0, rel=1e-6)
    assert second.preloads()["CUT"].force == pytest.approx(420.0 + 210.0, rel=1e-6)
    assert found.source("preload", "CUT").card == "*PRE-TENSION SECTION"


def test_axes_of_a_set_turn_what_is_held_and_loaded(tmp_path: Path) -> None:
    """A bar that lies at 30 degrees, held and pulled along its own axes."""
    turn = np.array([[np.sqrt(3) / 2, -0.5, 0.0], [0.5, np.sqrt(3) / 2, 0.0], [0.0, 0.0, 1.0]])
    mesh = block((0, 0, 0), (4, 1, 1), (4, 1, 1)).placed(turn, np.zeros(3))
    text = mesh_cards({"BAR": mesh}) + STEEL + SECTION + "*NSET, NSET=ALL, GENERATE\n1, 20\n"
    axes = ", ".join(f"{value:.16g}" for value in turn.T[:2].ravel())
    held = f"*TRANSFORM, NSET=ALL, TYPE=R\n{axes}\n*BOUNDARY\nBAR_X0, 1\nBAR_Y0, 2\n1, 3\n17, 3\n3, 3\n"
    found = read_deck(deck(tmp_path, text + held + step("*CLOAD\nBAR_X1, 1, 52.5\n")))
    assert all(isinstance(each, Roller) for each in found.scene.supports)
    (state,) = found.solve(MPI.COMM_SELF, tolerance=1e-10)
    moved = state.gather_displacement("BAR") @ turn
    points = mesh.points @ turn
    np.testing.assert_allclose(moved, points * [1e-3, -3e-4, -3e-4], atol=1e-9)


def test_nodes_of_a_ring_are_pushed_along_their_radii(tmp_path: Path) -> None:
    """A quarter of a ring, in plane strain, whose inner side moves outwards by 0.01: Lamé's solution."""
    flat = rectangle((1.0, 0.0), (2.0, 1.0), (24, 12))
    angle = flat.points[:, 1] * np.pi / 2
    mesh = flat.moved(flat.points[:, :1] * np.column_stack([np.cos(angle), np.sin(angle)]))
    text = mesh_cards({"BAR": mesh}, "CPE4") + STEEL + SECTION
    text += "*TRANSFORM, NSET=BAR_X0, TYPE=C\n0., 0., 0., 0., 0., 1.\n*BOUNDARY\nBAR_Y0, 2\nBAR_Y1, 1\n"
    text = text.replace("*NSET, NSET=BAR_Y0\n1,\n", "*NSET, NSET=BAR_Y0\n").replace(
        "*NSET, NSET=BAR_Y1\n13,\n", "*NSET, NSET=BAR_Y1\n"
    )
    found = read_deck(deck(tmp_path, text + step("*BOUNDARY\nBAR_X0, 1, 1, 0.01\nBAR_X0, 2, 2\n")))
    (state,) = found.solve(MPI.COMM_SELF, tolerance=1e-10)
    outer = np.linalg.norm(state.gather_displacement("BAR")[mesh.surfaces["x1"][:, 0]], axis=1)
    a, b, nu = 1.0, 2.0, 0.3
    exact = 0.01 * (b * (1 - 2 * nu) + b) / (a * (1 - 2 * nu) + b**2 / a)
    np.testing.assert_allclose(outer, exact, rtol=5e-3)


def test_nodes_of_a_cylinder_turn_from_x_to_y(tmp_path: Path) -> None:
    text = BAR + "*TRANSFORM, NSET=BAR_X1, TYPE=C\n0., 0., 0., 0., 0., 1.\n" + FIXED
    found = read_deck(deck(tmp_path, text + step("*BOUNDARY\nBAR_X1, 1, 1\nBAR_X1, 2, 2, 0.01\n")))
    (state,) = found.solve(MPI.COMM_SELF, tolerance=1e-10)
    moved = dict(zip(found.node_numbers["BAR"].tolist(), state.gather_displacement("BAR"), strict=True))
    np.testing.assert_allclose(moved[17][:2], [0.0, 0.01], atol=1e-12)  # at y = 0


#: Axes of nodes of a plate, what holds them, and the axis that is out of the plane.
OUT_OF_THE_PLANE = [
    ("1., 0., 0., 0., 0., 1.", "2", r"2 of node \d, \(0, 0, 1\)"),
    ("1., 0., 0., 0., 1., 1.", "2, 2, 0.01", r"2 of node \d, \(0, 0.7071, 0.7071\)"),
    # The third one is −y, which holds the nodes, though plane elements have no third component.
    ("1., 0., 0., 0., 0., 1.", "3", r"3 of node \d, \(0, -1, 0\)"),
    ("1., 0., 0., 0., 0., 1.", "1, 2", r"2 of node \d, \(0, 0, 1\)"),
]


def _plate(axes: str, held: str) -> str:
    plate = mesh_cards({"BAR": rectangle((0, 0), (2, 1), (2, 1))}, "CPE4") + STEEL + SECTION
    return plate + f"*TRANSFORM, NSET=BAR_X0, TYPE=R\n{axes}\n*BOUNDARY\nBAR_X1, 1, 2\nBAR_X0, {held}\n"


@pytest.mark.parametrize(("axes", "held", "message"), OUT_OF_THE_PLANE)
def test_nodes_of_plane_elements_are_held_in_the_plane(
    axes: str, held: str, message: str, tmp_path: Path
) -> None:
    text = _plate(axes, held)
    line = 1 + text.splitlines().index(f"BAR_X0, {held}")
    with pytest.raises(DeckError, match=rf"line {line}\D.*\*BOUNDARY: \*TRANSFORM axis {message}"):
        read_deck(deck(tmp_path, text + step("*DLOAD\nBAR, P1, 1.\n")))


@pytest.mark.parametrize(
    ("axes", "held"), [("1., 0., 0., 0., 0., 1.", "1, 3"), ("0., 1., 0., 1., 0., 0.", "2")]
)
def test_axes_that_turn_the_plane_over_and_nodes_that_are_held_wholly_are_read(
    axes: str, held: str, tmp_path: Path
) -> None:
    found = read_deck(deck(tmp_path, _plate(axes, held) + step("*DLOAD\nBAR, P1, 1.\n")))
    (state,) = found.solve(MPI.COMM_SELF, tolerance=1e-10)
    moved, x = state.gather_displacement("BAR"), found.scene.bodies["BAR"].mesh.points[:, 0]
    np.testing.assert_allclose(moved[x == 0.0, 0], 0.0, atol=1e-14)


OBLIQUE = "*TRANSFORM, NSET=BAR_X1, TYPE=R\n1., 0., 0., 0., 1., 1.\n"
DRIVEN = "*NODE\n90, 2., 0.5, 0.\n*RIGID BODY, NSET=BAR_X1, REF NODE=90\n"


@pytest.mark.parametrize(
    ("before", "load", "node"),
    [("", "5, 3, 2.", 5), (OBLIQUE, "6, 2, 2.", 6), (DRIVEN, "90, 3, 2.", 90), (DRIVEN, "90, 5, 2.", 90)],
)
def test_plane_elements_take_no_forces_out_of_the_plane(
    before: str, load: str, node: int, tmp_path: Path
) -> None:
    plate = mesh_cards({"BAR": rectangle((0, 0), (2, 1), (2, 1))}, "CPE4") + STEEL + SECTION
    held = plate + before + "*BOUNDARY\nBAR_X0, 1, 2\n"
    message = rf"\*STEP.* node {node} has a \*CLOAD"
    with pytest.raises(DeckError, match=message):
        read_deck(deck(tmp_path, held + step(f"*CLOAD\n{load}\n")))
    allowed = "*CLOAD\n5, 1, 2.\n5, 3, 0.\n" + "90, 6, 1.\n" * (before == DRIVEN)
    assert read_deck(deck(tmp_path, held + step(allowed))).steps


@pytest.mark.parametrize("terms", ["1\n6, 2, 1.", "2\n3, 1, 1., 5, 2, -1."])
def test_equations_of_plane_elements_are_along_axes_in_the_plane(terms: str, tmp_path: Path) -> None:
    plate = mesh_cards({"BAR": rectangle((0, 0), (2, 1), (2, 1))}, "CPE4") + STEEL + SECTION
    held = plate + OBLIQUE + "*BOUNDARY\nBAR_X0, 1, 2\n"
    with pytest.raises(DeckError, match=r"axis 2 of node \d is out of the plane"):
        read_deck(deck(tmp_path, held + f"*EQUATION\n{terms}\n" + step("*CLOAD\n5, 1, 2.\n")))
    in_plane = f"*EQUATION\n{terms}\n".replace(", 2, ", ", 1, ")
    assert read_deck(deck(tmp_path, held + in_plane + step("*CLOAD\n5, 1, 2.\n"))).steps


def test_equations_let_nodes_slide_and_move_alike(tmp_path: Path) -> None:
    slide = "*EQUATION\n2\n17, 1, 1., 17, 2, 1.\n2\n18, 3, 1., 20, 3, -1.\n"
    found = read_deck(deck(tmp_path, BAR + FIXED + slide + step("*CLOAD\n17, 2, 5.\n20, 3, -4.\n")))
    assert [type(each) for each in found.scene.supports] == [Support, Roller]
    assert [type(each) for each in found.scene.constraints] == [LinearConstraint]
    (state,) = found.solve(MPI.COMM_SELF, tolerance=1e-10)
    moved = dict(zip(found.node_numbers["BAR"].tolist(), state.gather_displacement("BAR"), strict=True))
    assert abs(moved[17][0]) > 1e-6
    assert moved[17][0] == pytest.approx(-moved[17][1], abs=1e-10)
    assert moved[18][2] == pytest.approx(moved[20][2], abs=1e-10)


def test_an_equation_of_a_node_with_axes_is_along_these(tmp_path: Path) -> None:
    """Local components 1 and 2 are y and −x."""
    turned = "*NSET, NSET=T\n17\n*TRANSFORM, NSET=T, TYPE=R\n0., 1., 0., -1., 0., 0.\n"
    slide = "*EQUATION\n2\n17, 1, 3., 17, 2, 1.\n"
    found = read_deck(deck(tmp_path, BAR + FIXED + turned + slide + step("*CLOAD\n18, 2, 5.\n")))
    (state,) = found.solve(MPI.COMM_SELF, tolerance=1e-10)
    moved = dict(zip(found.node_numbers["BAR"].tolist(), state.gather_displacement("BAR"), strict=True))
    assert abs(moved[17][1]) > 1e-8
    assert 3 * moved[17][1] == pytest.approx(moved[17][0], abs=1e-12)


def test_an_equation_of_several_nodes_is_along_their_axes_and_has_the_value_of_a_node_alone(
    tmp_path: Path,
) -> None:
    """u_x of node 17, whose axis 1 is y, and three times that of 18 add up to half that of node 501."""
    turned = "*NSET, NSET=T\n17\n*TRANSFORM, NSET=T, TYPE=R\n0., 1., 0., -1., 0., 0.\n"
    slide = "*EQUATION\n3\n17, 1, 1., 18, 1, 3.,\n501, 2, -0.5\n"
    steps = step("*BOUNDARY\n501, 2, 2, 0.01\n") + step("*BOUNDARY\n501, 2, 2, -0.03\n")
    found = read_deck(deck(tmp_path, BAR + REFERENCE + FIXED + turned + slide + steps))
    for state, value in zip(found.solve(MPI.COMM_SELF, tolerance=1e-11), (0.005, -0.015), strict=True):
        moved = dict(zip(found.node_numbers["BAR"].tolist(), state.gather_displacement("BAR"), strict=True))
        assert moved[17][1] + 3.0 * moved[18][0] == pytest.approx(value, rel=1e-8)
        held = state.constraints()["EQUATIONS"]
        np.testing.assert_allclose(held.on_bodies["BAR"], held.force * [3.0, 1.0, 0.0], rtol=1e-9)


def test_bodies_that_share_nodes_but_no_faces_are_joined_there(tmp_path: Path) -> None:
    """Two cubes with an edge in common: the load goes once to each of its nodes, and passes on."""
    cubes = "*NODE\n" + "".join(
        f"{k}, {x}, {y}, {z}\n"
        for k, (x, y, z) in enumerate(
            [(0, 0, 0), (1, 0, 0), (1, 1, 0), (0, 1, 0), (0, 0, 1), (1, 0, 1), (1, 1, 1), (0, 1, 1),
             (2, 1, 0), (2, 2, 0), (1, 2, 0), (2, 1, 1), (2, 2, 1), (1, 2, 1)], 1
        )
    )  # fmt: skip
    cubes += "*ELEMENT, TYPE=C3D8, ELSET=BAR\n1, 1, 2, 3, 4, 5, 6, 7, 8\n2, 3, 9, 10, 11, 7, 12, 13, 14\n"
    held = "*BOUNDARY\n1, 1, 3\n2, 2, 3\n4, 3\n5, 1, 2\n9, 2\n13, 3\n"
    text = cubes + STEEL + SECTION + held + step("*CLOAD\n3, 1, 4.\n11, 1, 8.\n*NODE PRINT\nU, RF\n")
    found = read_deck(deck(tmp_path, text))
    (state,) = found.solve(MPI.COMM_SELF, tolerance=1e-11)
    moved = {
        name: dict(zip(found.node_numbers[name].tolist(), state.gather_displacement(name), strict=True))
        for name in found.scene.bodies
    }
    for node in (3, 7):
        np.testing.assert_allclose(moved["BAR"][node], moved["BAR 2"][node], atol=1e-12)
    assert abs(moved["BAR"][3]).max() > 1e-6
    balance = state.balance()
    np.testing.assert_allclose(balance.loads.force, [12.0, 0.0, 0.0], atol=1e-9)
    np.testing.assert_allclose(balance.reactions.force, [-12.0, 0.0, 0.0], atol=1e-8)
    table, forces = found.tables(state)
    assert table.rows[:, 0].tolist() == list(range(1, 15))
    np.testing.assert_allclose(forces.rows[:, 1:].sum(axis=0), [-12.0, 0.0, 0.0], atol=1e-8)
    assert any("share 2 nodes: joined" in note for note in found.notes)


WRONG = [
    (
        "*TRANSFORM, NSET=REF, TYPE=R\n0., 1., 0., -1., 0., 0.\n" + KINEMATIC,
        r"the node of a rigid surface must not have a",
    ),
    (
        RIGID.replace("NSET=BAR_X1", "ELSET=FEW").replace("*RIGID", "*ELSET, ELSET=FEW\n1, 2\n*RIGID"),
        r"'FEW' must be faces on the boundary",
    ),
    (RIGID.replace("REF NODE=501, ROT NODE=502", ""), r"\*RIGID BODY: needs the parameter REFNODE="),
    (
        RIGID.replace("REF NODE=501, ", "") + RIGID.replace("REF NODE=501, ", "").replace("X1", "X0"),
        r"its ROT NODE is also of 'BAR_X1'",
    ),
    (KINEMATIC.replace("*KINEMATIC\n1, 6\n", ""), r"must be followed by \*KINEMATIC or \*DISTRIBUTING"),
    (
        KINEMATIC.replace("1, 6", "1, 2").replace("COUPLING,", "COUPLING, ORIENTATION=A,"),
        r"orientation 'A' is not there",
    ),
    (SPREAD + "*BOUNDARY\n501, 1\n", r"the node of a distributing coupling is held"),
    ("*BOUNDARY\n17, 4, 4, 0.1\n", r"17 has no rotation that can be prescribed"),
    ("*BOUNDARY\n501, 1\n*EQUATION\n1\n501, 1, 1.\n", r"needs a node of an element"),
    ("*EQUATION\n2\n17, 1, 1.\n", r"needs 2 terms of node, component and factor"),
    ("*NSET, NSET=TWO\n17, 18\n*EQUATION\n2\nBAR_X1, 1, 1., TWO, 1, -1.\n", r"sets must have as many nodes"),
    ("*EQUATION, REMOVE\n1\n", r"REMOVE is not read"),
    ("*TRANSFORM, NSET=BAR_X1, TYPE=S\n", r"needs TYPE=R or C and a line with two points"),
    (
        "*SURFACE, NAME=N, TYPE=NODE\n17,\n*PRE-TENSION SECTION, SURFACE=N, NODE=501\n",
        r"needs a surface of faces, 'N' has nodes",
    ),
    (
        "*SURFACE, NAME=B\n2, S4\n3, S1\n*PRE-TENSION SECTION, SURFACE=B, NODE=501\n",
        r"surface 'B' must be flat",
    ),
]


@pytest.mark.parametrize(("cards", "message"), WRONG, ids=[w[1][:30] for w in WRONG])
def test_what_couples_nothing_is_refused(cards: str, message: str, tmp_path: Path) -> None:
    with pytest.raises(DeckError, match=message):
        read_deck(deck(tmp_path, BAR + REFERENCE + FIXED + cards + step("*CLOAD\n501, 1, 1.\n")))
    with pytest.raises(DeckError, match=r"node 17 of a solid takes no moment"):
        read_deck(deck(tmp_path, BAR + FIXED + step("*CLOAD\n17, 5, 1.\n")))
