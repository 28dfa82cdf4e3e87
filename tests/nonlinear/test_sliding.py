"""Rubber that slides far over rubber and over rigid bodies."""

from __future__ import annotations

import re
from collections.abc import Sequence
from functools import cache

import numpy as np
import pytest
from mpi4py import MPI

from fenics_contact import (
    AutomaticSteps,
    Body,
    ContactPair,
    ContactProblem,
    Coulomb,
    DeformedState,
    LoadStep,
    MovingObstacle,
    RigidSphere,
    Scene,
    Support,
    Surface,
    TangentNewton,
    box_partition,
    solve_scene,
    solve_steps,
)
from fenics_contact.errors import LoadStepError
from fenics_contact.gallery import half_disc, rectangle
from tests.nonlinear.ironing import WAY, ironing
from tests.nonlinear.scenes import RUBBER, pressed, rounded


@cache
def ironed(pieces: int, quarter: bool = False) -> Sequence[DeformedState]:
    """States with friction, until the die slides."""
    scenes = [ironing(0.3, way, quarter) for way in WAY[:3]]
    parts = {
        "block": box_partition(ironing(0.0, WAY[0]).bodies["block"].mesh, (2 * pieces, pieces)),
        "die": box_partition(ironing(0.0, WAY[0]).bodies["die"].mesh, (pieces, pieces)),
    }
    problem = ContactProblem(scenes[0], MPI.COMM_SELF, partitions=parts, tolerance=1e-10)
    steps = [LoadStep(str(number), supports=scene.supports) for number, scene in enumerate(scenes)]
    states = solve_steps(problem, steps)
    assert all(isinstance(state, DeformedState) for state in states)
    return states  # type: ignore[return-value]


def force(state: DeformedState) -> np.ndarray:
    return np.asarray(state.reactions()[1].force)


def test_ironing_is_the_same_however_bodies_are_cut() -> None:
    torn, whole = ironed(2), ironed(1)
    for one, other in zip(torn, whole, strict=True):
        assert np.abs(force(one) - force(other)).max() < 1e-7 * np.abs(force(other)).max()
        moved = other.gather_displacement("block")
        assert np.abs(one.gather_displacement("block") - moved).max() < 1e-7 * np.abs(moved).max()
        assert one.balance().imbalance < 1e-8
    last = torn[-1].contact
    assert last.count(2) > 3, "it slides"
    worst = [line.residuals.worst for line in torn[1].solution.history]
    far = max(number for number, size in enumerate(worst) if size > 1e-8)  # nearer, forcing is loose
    assert worst[far + 1] < 10 * worst[far] ** 1.5, "superlinear, with friction between two bodies"


def test_ironing_turned_in_the_plane_gives_the_turned_answer() -> None:
    upright, turn = ironed(1)[-1], ironed(1, quarter=True)[-1]
    x, y = force(upright)
    assert np.abs(force(turn) - [-y, x]).max() < 1e-8 * np.abs(y)
    normal = upright.contact.normal_force
    assert np.abs(turn.contact.normal_force - normal).max() < 1e-8 * normal.max()


@pytest.mark.parametrize("parts", [1, 4])
def test_slip_is_how_far_nodes_have_gone_over_the_plane(parts: int) -> None:
    """Also without friction, in however many parts a load step is done; that of earlier steps is added up."""
    mesh = rounded(3)
    way = [(0.0, 0.3), (0.4, 0.3), (0.7, 0.3)]
    steps = [
        LoadStep(str(x), supports=pressed(mesh, depth, pushed=x, friction=0.0).supports) for x, depth in way
    ]
    problem = ContactProblem(
        pressed(mesh, 0.3, friction=0.0), MPI.COMM_SELF, steps=AutomaticSteps(first=1.0 / parts)
    )
    states = solve_steps(problem, steps)
    places = [state.gather_displacement("block") for state in states]
    for last, state, before in zip(places[1:], states[1:], places[:-1], strict=True):
        contact = state.contact
        points = contact.points
        gone = np.einsum("nad,nd->na", points.tangents, (last - before)[points.slave])
        since = np.einsum("nad,nd->na", points.tangents, (before - places[0])[points.slave])
        assert np.abs(gone).max() > 0.2
        np.testing.assert_allclose(contact.slip, gone, atol=1e-8)
        np.testing.assert_allclose(contact.slip_before - states[0].contact.slip, since, atol=1e-8)


def test_a_rigid_disc_deep_in_rubber() -> None:
    """Forces turn with the disc's surface: without their stiffness convergence would be linear."""
    block = rectangle((0.0, 0.0), (4.0, 2.0), (20, 10))
    ball = MovingObstacle(RigidSphere((2.0, 2.0 + 0.5), 0.5), lambda time: (None, (0.0, -0.5 * time)))
    scene = Scene(
        {"block": Body(block, RUBBER)},
        [Support("block", "y0")],
        contacts=[ContactPair(Surface("block", "y1"), ball)],
    )
    state = solve_scene(scene, MPI.COMM_SELF, tolerance=1e-10)
    worst = [line.residuals.worst for line in state.solution.history]
    assert isinstance(state, DeformedState)
    assert len(state.fractions) > 1, "the disc moves by several facets"
    assert worst[-1] < max(100 * worst[-2] ** 2, 1e-10), "quadratic"
    depth = -state.gather_displacement("block")[:, 1].min()
    assert abs(depth - 0.5) < 1e-8, "the lowest point of the disc carries a node with it"
    assert state.balance().imbalance < 1e-9


@pytest.mark.parametrize("discretisation", ["node", "mortar"])
@pytest.mark.parametrize("slave", ["plate", "roller"])
def test_friction_does_not_act_across_a_plane_of_symmetry(discretisation: str, slave: str) -> None:
    """Half of a roller on a plate: friction of nodes that cannot slip would only load supports."""
    plate, roller = rectangle((0, -4), (6, 0), (12, 8)), half_disc(5.0, 4, grading=1.0)
    sides = {"plate": "y1", "roller": "contact"}
    (master,) = set(sides) - {slave}
    pair = ContactPair(
        Surface(slave, sides[slave]), Surface(master, sides[master]), Coulomb(0.2), discretisation
    )
    scene = Scene(
        {"plate": Body(plate, RUBBER), "roller": Body(roller, RUBBER)},
        [
            *[Support(name, "x0", (0.0, None)) for name in sides],
            Support("plate", "y0", (None, 0.0)),
            Support("roller", "top", (None, -0.05)),
        ],
        contacts=[pair],
    )
    state = solve_scene(scene, MPI.COMM_SELF)
    contact = state.contact
    (cut,) = np.flatnonzero(np.abs(scene.points[contact.points.slave, 0]) < 1e-12)
    assert contact.normal_force[cut] > 1e-3
    assert contact.slip[cut] == 0.0
    assert np.linalg.norm(contact.force[cut]) == pytest.approx(contact.normal_force[cut], rel=1e-12)
    assert state.balance().imbalance < 1e-8


@pytest.mark.parametrize(("end", "told"), [(2.02, True), (1.9, False)])
def test_a_path_that_ends_where_nodes_leave_the_end_of_a_master_says_so(end: float, told: bool) -> None:
    """A node beyond the end by a few percent of a facet presses still; where it is lost, its force ends."""
    bodies = {"bed": Body(rectangle((0, 0), (2, 1), (2, 1)), RUBBER)}
    bodies["slider"] = Body(rectangle((1.2, 1), (end, 1.5), (1, 1)), RUBBER)
    pair = ContactPair(Surface("slider", "y0"), Surface("bed", "y1"), discretisation="node")
    held = [[Support("bed", "y0"), Support("slider", "y1", (0.0, -depth))] for depth in (0.02, 1.4)]
    steps = AutomaticSteps(TangentNewton(max_steps=8), smallest=1.0)
    problem = ContactProblem(Scene(bodies, held[0], contacts=[pair]), MPI.COMM_SELF, steps=steps)
    with pytest.raises(LoadStepError) as ended:
        solve_steps(problem, [LoadStep(str(n), supports=each) for n, each in enumerate(held)])
    words = r"; 1 node of surface 'y0' presses on 'y1' from beyond its end with \d\d\.\d% of the normal force"
    assert bool(re.search(words, str(ended.value))) == told, ended.value
