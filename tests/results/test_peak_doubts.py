"""A state says in one line what its meshes leave uncertain about the largest pressure."""

from __future__ import annotations

import logging
from collections import defaultdict

import numpy as np
import pytest
from mpi4py import MPI

from fenics_contact import (
    Body,
    ContactPair,
    RigidSphere,
    Scene,
    Support,
    Surface,
    Traction,
    solve_scene,
)
from fenics_contact._equilibrium.peaks import unmatched_nodes
from fenics_contact.gallery import rectangle
from fenics_contact.materials import PlaneStrain
from fenics_contact.mesh import quadratic
from fenics_contact.results.linear_state import LinearState
from fenics_contact.results.resolution import CALL, CoarsePeak, UnmatchedNodes, in_words
from tests.equilibrium.round_bodies import CELL, pressed
from tests.pairing.between_nodes import pressed_on_disc

PLACE = "upper y0 on lower y1"


def found(
    cells: float, ratio: float, discretisation: str = "mortar", axis: float = 0.1
) -> tuple[LinearState, float]:
    """Return the state of two cylinders, cells on the half width, and the error of its largest pressure."""
    scene, peak = pressed(2, cells, ratio, axis, discretisation)
    state = solve_scene(scene, MPI.COMM_SELF, tolerance=1e-6)
    assert isinstance(state, LinearState)
    return state, abs(float(state.contact.pressure.max()) / peak - 1.0)


@pytest.mark.parametrize(("cells", "ratio", "to_edge"), [(2.0, 3.0, 1), (3.0, 0.75, None), (5.0, 3.0, 2)])
def test_cells_to_the_edge_are_those_of_the_coarser_surface(
    cells: float, ratio: float, to_edge: int | None
) -> None:
    state, error = found(cells, ratio)
    assert [doubt.cells for doubt in state.peak_uncertainties if isinstance(doubt, CoarsePeak)] == (
        [] if to_edge is None else [to_edge]
    )
    assert error < {1: 1.4, 2: 0.23, None: 0.035}[to_edge]
    assert (error > 0.1) == (to_edge == 1)


def test_the_line_of_a_coarse_peak() -> None:
    state, error = found(1.5, 0.75)
    (doubt,) = state.peak_uncertainties
    words = f"may be off by a tenth, {PLACE} touch within 2 cells of it: {CALL} refines the meshes there"
    assert str(doubt) == words
    assert f"\n  peak pressure    {words}\n" in str(state)
    assert 0.01 < error < 0.23


def test_contact_by_nodes_wavers_where_meshes_do_not_match() -> None:
    state, error = found(5.0, 1.5, "node")
    (doubt,) = state.peak_uncertainties
    assert isinstance(doubt, UnmatchedNodes)
    assert str(doubt) == (
        f"wavers by some percent, {PLACE} touch by nodes where meshes do not match: leave out "
        "discretisation='node'"
    )
    better, smaller = found(5.0, 1.5)
    assert better.peak_uncertainties == ()
    assert "peak pressure" not in str(better)
    assert smaller < 0.01 < error
    assert unmatched_nodes(found(5.0, 1.0, "node")[0], 0) is None


def test_one_line_for_several_pairs() -> None:
    doubts = [CoarsePeak("a", 3, 1), UnmatchedNodes("b"), UnmatchedNodes("c")]
    words = f"may be off by a half or more, a touch within 1 cell of it: {CALL} refines the meshes there"
    assert in_words(doubts[:1]) == words
    assert in_words(doubts) == f"{words}; likewise 2 further pairs"


@pytest.mark.claim
def test_doubts_follow_errors() -> None:
    errors = defaultdict[int, list[float]](list)
    generator = np.random.default_rng(3)
    for ratio in (0.75, 1.5, 2.0, 3.0):
        for cells in (0.8, 1.0, 1.4, 1.8, 2.5, 3.0, 3.5, 4.0, 4.5):
            state, error = found(cells, ratio, axis=generator.uniform(0.0, CELL))
            doubts = (doubt.cells for doubt in state.peak_uncertainties if isinstance(doubt, CoarsePeak))
            errors[next(doubts, 3)].append(error)
    assert sum(map(len, errors.values())) == 36
    assert min(map(len, errors.values())) >= 6
    assert 0.1 < np.median(errors[1]) < 0.3
    assert 0.005 < np.median(errors[2]) < 0.05
    assert np.median(errors[3]) < 0.01
    assert max(errors[3]) < 0.035


def on_a_ball(turn: float, depth: float = 0.02, radius: float = 10.0) -> LinearState:
    """Return a block pressed on a ball by its upper side, which turns by a small angle, as plane bodies."""
    block = Body(rectangle((-4.0, 0.0), (4.0, 4.0), (32, 16)), PlaneStrain(1000.0, 0.3))
    down = depth - 0.5 * radius * turn**2
    lowered = Support("block", "y1", (-4.0 * turn, lambda x: turn * x[:, 0] - down))
    pair = ContactPair(Surface("block", "y0"), RigidSphere((0.0, -radius), radius))
    state = solve_scene(Scene({"block": block}, [lowered], contacts=[pair]), MPI.COMM_SELF)
    assert isinstance(state, LinearState)
    return state


@pytest.mark.parametrize("turn", [0.05, -0.05])
def test_a_block_that_turns_has_the_doubt_of_one_that_does_not(turn: float) -> None:
    """Where it turns, points of smaller gaps than those that press are open in the end."""
    level, turned = on_a_ball(0.0), on_a_ball(turn)
    closed = [int((each.contact.normal_force > 0.0).sum()) for each in (level, turned)]
    assert min(closed) > 2
    assert [doubt.cells for doubt in level.peak_uncertainties if isinstance(doubt, CoarsePeak)] == [2]
    assert [doubt.cells for doubt in turned.peak_uncertainties if isinstance(doubt, CoarsePeak)] == [2]


def test_one_point_that_a_bent_strip_presses_is_in_doubt() -> None:
    """Its force is 14 % off that of beam theory, as the lowest point of the ball lies between two nodes."""
    strip = Body(quadratic(rectangle((0.0, 0.0), (40.0, 1.0), (25, 2))), PlaneStrain(1e5, 0.0))
    tip, gap, at, stiffness = 0.234, 0.3, 38.8, 1e5 / 12.0
    pair = ContactPair(Surface("strip", "y1"), RigidSphere((at, 1.0 + gap + 2.0), 2.0))
    scene = Scene({"strip": strip}, [Support("strip", "x0")], [Traction("strip", "x1", (0.0, tip))], [pair])
    state = solve_scene(scene, MPI.COMM_SELF)
    assert isinstance(state, LinearState)
    free = tip * at**2 * (3.0 * 40.0 - at) / (6.0 * stiffness)
    beam = 3.0 * stiffness * (free - gap) / at**3
    assert 0.8 < state.contact.normal_force.sum() / beam < 0.9
    (doubt,) = state.peak_uncertainties
    assert isinstance(doubt, CoarsePeak)
    assert (doubt.points, doubt.cells) == (1, 1)


def test_one_point_that_presses_rubber_is_in_doubt(caplog: pytest.LogCaptureFixture) -> None:
    """Its force is off by a fifth; fine cells leave no doubt."""
    with caplog.at_level(logging.WARNING):
        fine = solve_scene(pressed_on_disc(0.3, 0.075, rubber=True), MPI.COMM_SELF)
    assert fine.peak_uncertainties == ()
    assert caplog.messages == []
    with caplog.at_level(logging.INFO):  # load histories pass through first touches
        coarse = solve_scene(pressed_on_disc(0.0, rubber=True), MPI.COMM_SELF)
    (doubt,) = coarse.peak_uncertainties
    assert isinstance(doubt, CoarsePeak)
    assert (doubt.points, doubt.cells) == (1, 1)
    assert doubt.warning in caplog.messages
    assert abs(coarse.contact.force[:, 1].sum() / fine.contact.force[:, 1].sum() - 1.0) > 0.2
