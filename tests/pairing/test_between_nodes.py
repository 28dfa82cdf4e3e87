"""Contact that is smaller than the cells of its slave is found between its nodes, and never in silence."""

from __future__ import annotations

import logging
from dataclasses import replace
from functools import cache
from typing import Any

import numpy as np
import pytest
from mpi4py import MPI

from fenics_contact import (
    Body,
    ContactPair,
    ContactProblem,
    Coulomb,
    RigidSphere,
    RigidTool,
    Scene,
    Support,
    Surface,
    solve_scene,
    solve_to,
)
from fenics_contact._equilibrium import between_nodes as searched
from fenics_contact._equilibrium.between_nodes import ALONE, SHARE, between_nodes
from fenics_contact._equilibrium.steps import stored_state
from fenics_contact._pairing.inside import InFacets, deepest_points
from fenics_contact._pairing.sliding.contact import SlidingContact
from fenics_contact._surfaces import projection
from fenics_contact.gallery import block
from fenics_contact.materials import IsotropicElasticity, J2Plasticity, PlaneStrain
from fenics_contact.results.linear_state import LinearState
from fenics_contact.results.resolution import CALL, BetweenNodes
from tests.pairing.between_nodes import (
    DEPTH,
    RADIUS,
    ball_of_triangles,
    hertz_on_ball,
    met_by_disc,
    on_tool,
    pressed_on_ball,
    pressed_on_disc,
)


@pytest.mark.parametrize("rubber", [False, True])
def test_contact_between_nodes_is_named_with_its_depth_and_what_to_do(
    rubber: bool, caplog: pytest.LogCaptureFixture
) -> None:
    state = solve_scene(pressed_on_disc(0.5, rubber=rubber), MPI.COMM_SELF, tolerance=1e-8)
    (doubt,) = (each for each in state.peak_uncertainties if isinstance(each, BetweenNodes))
    assert 0.3 * DEPTH < doubt.depth < 1.001 * DEPTH
    assert doubt.at[0] == pytest.approx(0.0, abs=1e-3)
    (words,) = (each for each in caplog.messages if "lies between nodes" in each)
    assert "the contact of plate y0 on rigid sphere lies between nodes" in words
    assert f"surfaces overlap by {doubt.depth:.2g} more than at its nodes" in words
    assert "its force, not only its largest pressure, may be off by a half or more" in words
    assert CALL in words
    assert f"peak pressure    {doubt}" in str(state)


@pytest.mark.parametrize(
    "scene", [pressed_on_disc(0.5), pressed_on_disc(0.2), pressed_on_ball((0.4, 0.3), 0.4)]
)
def test_where_samples_show_that_little_is_missed_nobody_looks_further(
    scene: Scene, monkeypatch: pytest.MonkeyPatch
) -> None:
    """And nothing is overlooked, also where what moves makes it just as much as counts, or just less."""
    whole = replace(solve_scene(scene, MPI.COMM_SELF, tolerance=1e-8), missed={})
    missed = between_nodes(whole, 0)
    assert missed is not None
    depth, looked = float(missed.deepest.missed.max()), []
    monkeypatch.setattr(searched, "deepest_points", lambda *of: looked.append(of) or deepest_points(*of))
    found = []
    for share in (0.01, 0.5, 0.99, 1.01, 2.0, 100.0):
        moved = depth / share / (SHARE if whole.contact.normal_force.any() else ALONE)
        fresh, here = replace(whole, missed={}), len(looked)
        both = between_nodes(fresh, 0, moved), between_nodes(whole, 0, moved)
        doubts = [each and each.doubt("here") for each in both]
        assert doubts[0] == doubts[1]
        found.append((bool(doubts[0]), len(looked) > here))
        assert (again := between_nodes(fresh, 0)) is not None
        assert again.doubt("here") == missed.doubt("here")
    assert found[0] == (False, False)
    assert found[-1][1]


def test_samples_are_projected_on_hardly_more_than_one_facet_each(monkeypatch: pytest.MonkeyPatch) -> None:
    lower, upper = block((0, 0, 0), (3, 3, 1), (5, 5, 1)), block((0, 0, 1), (3, 3, 2), (7, 7, 1))
    steel = IsotropicElasticity(2.1e5, 0.3)
    scene = Scene(
        {"lower": Body(lower, steel), "upper": Body(upper, steel)},
        supports=[Support("lower", "z0"), Support("upper", "z1", (0.0, 0.0, -1e-3))],
        contacts=[ContactPair(Surface("upper", "z0"), Surface("lower", "z1"))],
    )
    state = solve_scene(scene, MPI.COMM_SELF, tolerance=1e-8)
    solve, tried = projection._solve, []
    monkeypatch.setattr(projection, "_solve", lambda *of: tried.append(of[3]) or solve(*of))
    assert between_nodes(replace(state, missed={}), 0, 1e-3) is None
    samples = len(np.unique(np.concatenate(tried)))
    assert samples > 1000
    assert sum(map(len, tried)) < 1.2 * samples


def test_fine_meshes_touch_at_nodes(caplog: pytest.LogCaptureFixture) -> None:
    with caplog.at_level(logging.WARNING):
        state = solve_scene(pressed_on_disc(0.37, 0.075), MPI.COMM_SELF, tolerance=1e-8)
    assert not any(isinstance(each, BetweenNodes) for each in state.peak_uncertainties)
    assert state.torn.points.are_at_nodes
    assert state.contact.normal_force.sum() > 0.0
    assert not [each for each in caplog.messages if "between nodes" in each]


def test_an_accuracy_is_reached_from_a_mesh_that_misses_the_contact() -> None:
    result = solve_to(pressed_on_disc(0.5), "peak_pressure", 0.05, MPI.COMM_SELF)
    assert result.relative_error < 0.05
    assert result.value == pytest.approx(float(fine()[1].contact.pressure.max()), rel=0.05)


@cache
def fine() -> tuple[float, LinearState]:
    """Return the force of the disc and the state on a mesh with four cells on the half width."""
    return force_on(pressed_on_disc(0.3, 0.055))


def force_on(scene: Any) -> tuple[float, LinearState]:
    """Return the force along the last axis, and the state."""
    state = solve_scene(scene, MPI.COMM_SELF, tolerance=1e-8)
    assert isinstance(state, LinearState)
    return float(state.contact.force[:, -1].sum()), state


#: Sizes of cells, of which a quarter, a half and two lie on the half width of the contact, 0.224; errors.
SIZES = {1.0: 0.6, 0.45: 0.12, 0.11: 0.01}


@pytest.mark.parametrize("cell", SIZES)
@pytest.mark.parametrize("offsets", [2, pytest.param(20, marks=pytest.mark.claim)])
def test_forces_are_found_wherever_nodes_lie(cell: float, offsets: int) -> None:
    for offset in (0.5, *np.random.default_rng(5).uniform(0.0, 0.5, offsets)):
        force, state = force_on(pressed_on_disc(offset, cell))
        error = abs(force / fine()[0] - 1.0)
        assert error < SIZES[cell]
        assert error < 0.05 or state.peak_uncertainties


@pytest.mark.parametrize(("offset", "on"), [(0.5, None), (0.42, None), (0.42, on_tool), (0.5, met_by_disc)])
def test_rubber_between_nodes_presses_as_what_is_linear(offset: float, on: Any) -> None:
    linear, _ = force_on(pressed_on_disc(offset, material=PlaneStrain(5.0, 0.4)))
    scene = pressed_on_disc(offset, rubber=True)
    state = solve_scene(scene if on is None else on(scene), MPI.COMM_SELF, tolerance=1e-8)
    assert len(state.contact.points.are_inside) == 1
    # Where the disc moves, the gaps around the spot change by its motion, too.
    error = 0.05 if on is met_by_disc else 0.005
    assert float(state.contact.force[:, 1].sum()) == pytest.approx(linear, rel=error)
    assert any(isinstance(each, BetweenNodes) for each in state.peak_uncertainties)


def test_materials_that_do_not_yield_press_between_nodes_as_elastic_ones() -> None:
    friction, soft = Coulomb(0.3), J2Plasticity(2.1e5, 0.3, 1e9)
    force, linear = force_on(pressed_on_disc(0.42, friction=friction))
    scene = pressed_on_disc(0.42, friction=friction, material=soft)
    problem = ContactProblem(scene, MPI.COMM_SELF, tolerance=1e-8)
    state = problem.solve()
    np.testing.assert_array_equal(state.contact.points.are_inside, linear.contact.points.are_inside)
    np.testing.assert_allclose(state.contact.force, linear.contact.force, atol=1e-6 * force)
    again = problem.restore(stored_state(state))
    np.testing.assert_allclose(again.contact.force, state.contact.force, atol=1e-9 * force)


def test_rubber_between_nodes_is_restored_and_goes_on_in_load_steps() -> None:
    scene = pressed_on_disc(0.5, rubber=True, friction=Coulomb(0.2))
    problem = ContactProblem(scene, MPI.COMM_SELF, tolerance=1e-9)
    first = problem.solve()
    again = problem.restore(stored_state(first))
    np.testing.assert_allclose(again.contact.force, first.contact.force, atol=1e-9)
    np.testing.assert_allclose(problem.solve(before=first).contact.force, first.contact.force, atol=1e-7)
    deeper = replace(scene, supports=[Support("plate", "y1", (0.0, -2.0 * DEPTH))])
    further = problem.solve(deeper, before=first).contact.force[:, 1].sum()
    at_once = solve_scene(deeper, MPI.COMM_SELF, tolerance=1e-9).contact.force[:, 1].sum()
    assert float(further) == pytest.approx(float(at_once), rel=0.05)
    away = replace(scene, supports=[Support("plate", "y1", (0.0, DEPTH))])
    assert not problem.solve(away, before=first).contact.force.any()


def test_forces_inside_facets_have_exact_derivatives() -> None:
    scene, rng = pressed_on_ball((0.2, 0.3), 1.0), np.random.default_rng(3)
    sliding = SlidingContact.of(scene, np.zeros(scene.points.shape, dtype=bool))
    places = scene.points + 0.05 * rng.normal(size=scene.points.shape)
    nearest = sliding.at(places).points.slave[[40]]
    inside = InFacets(nearest, np.array([40]), np.array([[0.3, -0.2]]), np.array([0.01]))
    sliding = sliding.with_inside(inside)
    now, way, step = sliding.at(places), rng.normal(size=places.shape), 1e-5
    assert len(now.points.are_inside) == 1
    multiplier = rng.uniform(1.0, 2.0, now.points.count)

    def force(at: np.ndarray) -> np.ndarray:
        points = sliding.at(at).points
        return np.asarray(-points.on_nodes(multiplier[:, None] * points.normal).ravel())

    quotient = (force(places + step * way) - force(places - step * way)) / (2.0 * step)
    stiffness = now.stiffness(multiplier).assembled() @ way.ravel()
    np.testing.assert_allclose(stiffness, quotient, atol=1e-8 * np.abs(quotient).max())


TOOL = RigidTool("ball", RigidSphere((0.0, 0.0, -RADIUS), RADIUS), at=(0.0, 0.0, 0.0))


@pytest.mark.parametrize(
    ("offset", "master"),
    [
        pytest.param((0.0, 0.0), None, id="middle"),
        pytest.param((0.2, 0.2), None, id="ball"),
        pytest.param((0.2, 0.2), TOOL, id="tool"),
        pytest.param((0.2, 0.2), ball_of_triangles(), id="triangles"),
        pytest.param((0.0, 0.0), TOOL, id="tool in the middle", marks=pytest.mark.claim),
        pytest.param((0.0, 0.0), ball_of_triangles(), id="a corner in the middle", marks=pytest.mark.claim),
    ],
)
def test_a_ball_between_the_nodes_presses_like_hertz(offset: tuple[float, float], master: Any) -> None:
    force, state = force_on(pressed_on_ball(offset, 0.447, master))
    assert len(state.torn.points.are_inside) == 1
    assert force == pytest.approx(hertz_on_ball(0.447), rel=0.15)
    assert any(isinstance(each, BetweenNodes) for each in state.peak_uncertainties)


def test_a_force_inside_a_facet_is_in_balance_with_friction_and_about_every_point() -> None:
    scene = pressed_on_ball((0.1, 0.0), 0.447, friction=Coulomb(0.3))
    state = solve_scene(scene, MPI.COMM_SELF, tolerance=1e-10)
    assert len(state.torn.points.are_inside) == 1
    about = (3.0, -2.0, 5.0)
    (contact,), (support,) = state.resultants(about).contacts, state.reactions(about)
    np.testing.assert_allclose(contact.force, -np.array(support.force), atol=1e-5 * abs(contact.force[2]))
    np.testing.assert_allclose(contact.moment, -np.array(support.moment), atol=1e-4 * abs(contact.force[2]))


def test_states_with_points_inside_facets_are_restored() -> None:
    problem = ContactProblem(pressed_on_disc(0.5, friction=Coulomb(0.2)), MPI.COMM_SELF, tolerance=1e-9)
    state = problem.solve()
    assert len(state.torn.points.are_inside) == 1
    again = problem.restore(stored_state(state))
    np.testing.assert_array_equal(again.torn.points.are_inside, state.torn.points.are_inside)
    np.testing.assert_allclose(again.torn_displacement, state.torn_displacement, atol=1e-9 * DEPTH)
    assert again.solution.natural_residual < 1e-8


def test_next_load_steps_find_their_own_points() -> None:
    problem = ContactProblem(pressed_on_disc(0.5), MPI.COMM_SELF, tolerance=1e-9)
    first = problem.solve()
    again = problem.solve(before=first)
    np.testing.assert_allclose(again.contact.normal_force, first.contact.normal_force, rtol=1e-6)
    assert len(again.torn.points.are_inside) == 1


ON_RANKS = """
from mpi4py import MPI
from fenics_contact import solve_scene
from tests.pairing.between_nodes import pressed_on_disc
state = solve_scene(pressed_on_disc(0.42), MPI.COMM_WORLD, tolerance=1e-9)
if MPI.COMM_WORLD.rank == 0:
    print(repr(float(state.contact.force[:, 1].sum())), len(state.torn.points.are_inside))
"""


def test_every_rank_finds_the_same_points(mpirun: Any) -> None:
    forces = [mpirun(ON_RANKS, ranks).split() for ranks in (1, 2)]
    assert forces[0][1] == forces[1][1] == "1"
    assert float(forces[0][0]) == pytest.approx(float(forces[1][0]), rel=1e-6)
