"""The edge between a tie and a contact, or between two contacts, has one answer or a word about it."""

from __future__ import annotations

import logging
from dataclasses import replace

import numpy as np
import pytest
from mpi4py import MPI

from fenics_contact.contact import solve_scene
from fenics_contact.gallery import rectangle
from fenics_contact.scene import (
    Body,
    ContactPair,
    Discretisation,
    NeoHooke,
    Scene,
    Support,
    Surface,
    Tie,
    Traction,
)
from tests.contact.half_tied import MATERIAL, half_tied, solved


@pytest.mark.parametrize(
    ("columns", "discretisation", "sliding"),
    [(5, "node", True), (5, "node", False), (6, "mortar", True), (5, "mortar", True)],
)
def test_an_edge_between_tie_and_contact_has_one_answer_for_every_partition(
    columns: int, discretisation: Discretisation, sliding: bool
) -> None:
    scene = half_tied(columns, discretisation, sliding)
    first, *others = (solved(scene, parts) for parts in ((1, 1), (2, 3), (4, 4), (6, 5), (3, 7)))
    expected, force = first.gather_displacement("up"), first.contact.normal_force
    for other in others:
        found = other.gather_displacement("up")
        np.testing.assert_allclose(found, expected, rtol=0.0, atol=1e-7 * np.abs(expected).max())
        np.testing.assert_allclose(other.contact.normal_force, force, rtol=0.0, atol=1e-6 * force.max())


def test_tied_nodes_of_a_contact_are_counted(caplog: pytest.LogCaptureFixture) -> None:
    with caplog.at_level(logging.INFO, "fenics_contact"):
        state = solved(half_tied(5, "node", sliding=False), (1, 1))
    words = "1 nodes of the contact of low free on up y0 are no contact points: low tied on up y0 ties them"
    assert words in caplog.text
    assert state.contact_places[:, 0].min() > 1.01


@pytest.mark.parametrize("gap", [None, 0.001])
@pytest.mark.parametrize("discretisation", ["node", "mortar"])
def test_a_tied_node_is_no_contact_point_where_bodies_deform_much(
    discretisation: Discretisation, gap: float | None
) -> None:
    scene = half_tied(6, discretisation, sliding=False)
    rubber = {name: replace(body, material=NeoHooke(1.0, 0.3)) for name, body in scene.bodies.items()}
    held = [Support("low", "y0"), Support("up", "y1", (0.01, -0.02))]
    pairs = [replace(scene.contacts[0], gap=gap)]
    state = solved(replace(scene, bodies=rubber, supports=held, contacts=pairs), (1, 2))
    assert state.contact.points.count == 3
    assert state.contact_places[:, 0].min() > 1.1
    assert state.contact.normal_force.min() > 0.0


@pytest.mark.parametrize("side", ["x1", "y0"])
def test_a_corner_between_tie_and_contact_stays_a_contact_point(side: str) -> None:
    """A block that may slide on the floor keeps the contact of its corner with a wall; its base has none."""
    floor, block = rectangle((0, 0), (1, 1), (2, 2)), rectangle((0, 1), (1, 2), (2, 2))
    wall = rectangle((1, 0), (2, 2), (2, 4))
    master = Surface("wall", "x0") if side == "x1" else Surface("floor", "y1")
    scene = Scene(
        {name: Body(mesh, MATERIAL) for name, mesh in (("floor", floor), ("block", block), ("wall", wall))},
        [Support("floor", "y0"), Support("wall", "x1")],
        [Traction("block", "x0", (1e-3, -1e-3))],
        contacts=[ContactPair(Surface("block", "x1"), Surface("wall", "x0"), discretisation="node")],
        ties=[Tie(Surface("block", "y0"), Surface("floor", "y1"), sliding=True, discretisation="node")],
    )
    if side == "y0":
        again = ContactPair(Surface("block", "y0"), master, discretisation="node")
        scene = replace(scene, contacts=[*scene.contacts, again])
    points = solved_points(scene)
    assert list(np.bincount(points, minlength=2)) == [3, 0]


def solved_points(scene: Scene) -> np.ndarray:
    return solve_scene(scene, MPI.COMM_SELF).contact.points.pair
