"""The edge between a tie and a contact, or between two contacts, has one answer or a word about it."""

from __future__ import annotations

import logging
from dataclasses import replace

import numpy as np
import pytest
from mpi4py import MPI

from fenics_contact import (
    Body,
    ContactPair,
    RigidSurface,
    Scene,
    State,
    Status,
    Support,
    Surface,
    Tie,
    Traction,
    solve_scene,
)
from fenics_contact.errors import ConvergenceError, InfeasibleError
from fenics_contact.gallery import rectangle
from fenics_contact.materials import NeoHooke
from fenics_contact.qp import FaceNewton, face_newton
from tests.feti.half_tied import MATERIAL, half_tied, solved


@pytest.mark.parametrize(
    ("columns", "discretisation", "sliding"),
    [(5, "node", True), (5, "node", False), (6, "mortar", True), (5, "mortar", True)],
)
def test_an_edge_between_tie_and_contact_has_one_answer_for_every_partition(
    columns: int, discretisation: str, sliding: bool
) -> None:
    scene = half_tied(columns, discretisation, sliding)
    first, *others = (solved(scene, parts) for parts in ((1, 1), (2, 3), (4, 4), (6, 5), (3, 7)))
    expected, force = first.gather_displacement("up"), first.contact.normal_force
    for other in others:
        found = other.gather_displacement("up")
        np.testing.assert_allclose(found, expected, rtol=0.0, atol=1e-7 * np.abs(expected).max())
        np.testing.assert_allclose(other.contact.normal_force, force, rtol=0.0, atol=1e-6 * force.max())


@pytest.mark.parametrize("parts", [(1, 1), (6, 5)])
def test_a_drag_beyond_what_friction_bears_beside_a_sliding_tie_is_refused(parts: tuple[int, int]) -> None:
    """A tie in tension could press the contact without end: only deformed bodies show that it does not."""
    scene = half_tied(5, "node", sliding=True)

    def dragged(force: float) -> State:
        top = RigidSurface("up", "y1", (0.7, 1.5), force=(force, -1e-2), moment=-4e-4)
        return solved(replace(scene, supports=[scene.supports[0], top]), parts)

    assert dragged(1.275e-3).contact.count(Status.STICK) == 1
    for force, share in ((1.295e-3, r"99\.[123]"), (2e-3, r"6[89]\S*")):
        words = rf"the load makes slide 'up' by translation \(1, 0\), and friction carries only {share} %"
        with pytest.raises(InfeasibleError, match=words):
            dragged(force)


def test_a_solver_that_has_tried_all_says_that_friction_does_not_suffice(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    """As where discs stick and slip in turn, so that nothing calls for the test before."""
    monkeypatch.setattr(face_newton, "slides", lambda history: False)
    scene = half_tied(5, "node", sliding=True)
    top = RigidSurface("up", "y1", (0.7, 1.5), force=(2e-3, -1e-2), moment=-4e-4)
    hasty = FaceNewton(1e-10, max_products=450)
    with pytest.raises(InfeasibleError, match=r"friction carries only 6[89]\S* %") as caught:
        solve_scene(replace(scene, supports=[scene.supports[0], top]), MPI.COMM_SELF, solver=hasty)
    assert isinstance(caught.value.__cause__, ConvergenceError)
    assert caught.value.__cause__.history


def test_tied_nodes_of_a_contact_are_counted(caplog: pytest.LogCaptureFixture) -> None:
    with caplog.at_level(logging.INFO, "fenics_contact"):
        state = solved(half_tied(5, "node", sliding=False), (1, 1))
    words = "the contact of low free on up y0 leaves out 1 node, where the force is that of low tied on up y0"
    assert words in caplog.text
    assert state.contact_places[:, 0].min() > 1.01


@pytest.mark.parametrize("gap", [None, 0.001])
@pytest.mark.parametrize("discretisation", ["node", "mortar"])
def test_a_tied_node_is_no_contact_point_where_bodies_deform_much(
    discretisation: str, gap: float | None
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
