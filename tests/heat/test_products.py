"""Products of the dual solver for heat: bounded in the number of subdomains, by step, film and contrast."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from mpi4py import MPI

from fenics_contact import RigidPlane, Surface, box_partition
from fenics_contact.gallery import block, rectangle
from fenics_contact.heat import (
    ConductingBody,
    Conductor,
    Convection,
    GapConductance,
    HeatProblem,
    HeatScene,
    HeatSource,
    HeatState,
    HeldTemperature,
    ThermalContact,
    solve_heat,
)
from fenics_contact.heat.assembly import Rate
from tests.heat.bodies import Cut, boxes, waves


def filmed(coefficient: float, *counts: int) -> Cut:
    """Return such a body with a film all around and no held temperature."""
    scene, cut = boxes(*counts)
    films = [
        Convection("body", name, coefficient, lambda x: np.cos(x[:, 0]))
        for name in scene.bodies["body"].mesh.surfaces
    ]
    return replace(scene, loads=[*scene.loads, *films]), cut


def stacked(conductance: float, *counts: int) -> Cut:
    """Return two such bodies one on the other, meshes of which do not match."""
    below, above = (block((0, 0, z), (counts[0], counts[1], z + counts[2]), tuple(n * c for c in counts))
                    for z, n in ((0.0, 3), (float(counts[2]), 2)))  # fmt: skip
    bodies = {
        name: ConductingBody(mesh, Conductor(1.0, 1.0)) for name, mesh in (("low", below), ("up", above))
    }
    film = ThermalContact(Surface("up", "z0"), Surface("low", "z1"), conductance)
    scene = HeatScene(bodies, [HeldTemperature("low", "z0", 0.0)], [HeatSource("up", waves)], contacts=[film])
    return scene, {name: box_partition(body.mesh, counts) for name, body in bodies.items()}


def solved(given: Cut, step: float = np.inf) -> HeatState:
    """Return the steady state, or that at the end of a time step."""
    problem = HeatProblem(given[0], MPI.COMM_SELF, partitions=given[1])
    before = np.concatenate([body.mesh.points[:, 0] % 1.7 for body in given[0].bodies.values()])
    return problem.solve(rate=Rate(1.0 / step, before, problem.no_rate.history))


STEPS = [1e-6, 1e-3, 1.0, 1e3, 1e6, np.inf]


@pytest.mark.parametrize("step", STEPS[::2])
def test_products_are_bounded_for_any_time_step(step: float):
    few, more = (solved(boxes(n, n, n, cells=2, held=True), step).products for n in (2, 3))
    assert few <= 17  # a long step is corrected once, see `test_accuracy`
    assert more <= 24


@pytest.mark.parametrize("coefficient", [1e-6, 1.0, 1e6])
def test_products_are_bounded_for_any_film(coefficient: float):
    few, more = (solved(filmed(coefficient, n, n, n)).products for n in (2, 3))
    assert few <= 12
    assert more <= 20


@pytest.mark.parametrize("step", [1e-6, 1.0])
@pytest.mark.parametrize("capacity", [1e-6, 1e6])
@pytest.mark.parametrize("conductivity", [1e-6, 1.0])
def test_neighbours_that_store_differently_share_jumps_by_it(
    conductivity: float, capacity: float, step: float
):
    # By conductivities alone: up to 178.
    assert solved(boxes(2, 2, 2, cells=2, other=Conductor(conductivity, capacity)), step).products <= 18


def test_a_strong_film_may_end_where_subdomains_do():
    # By conductivities alone: 38.
    scene, cut = boxes(3, 3, 3)
    squares = Convection("body", "x1", lambda x: 1e6 * (np.floor(0.999 * x[:, 1:]).sum(axis=1) % 2), 1.0)
    assert solved((replace(scene, loads=[*scene.loads, squares]), cut)).products <= 20


@pytest.mark.parametrize("conductance", [1e-6, 1.0, 1e6])
@pytest.mark.parametrize("step", [1e-6, np.inf])
def test_products_are_bounded_for_any_conductance_and_step(conductance: float, step: float):
    # By conductivities alone: 95 with a small step and a conductance of one.
    assert solved(stacked(conductance, 2, 2, 1), step).products <= 16


@pytest.mark.slow
@pytest.mark.parametrize("step", STEPS)
def test_products_do_not_grow_with_the_number_of_subdomains(step: float):
    few, more = (solved(boxes(n, n, n, held=True), step).products for n in (4, 6))
    assert more <= few + 1


@pytest.mark.slow
@pytest.mark.parametrize("coefficient", [1e-6, 1e-3, 1.0, 1e3, 1e6])
def test_products_do_not_grow_where_only_films_hold(coefficient: float):
    # Films of the order of conduction: 20, 22, 23, 23, 23 with 4 to 8 subdomains a side.
    few, more = (solved(filmed(coefficient, n, n, n)).products for n in (4, 6))
    assert more <= few + 3


@pytest.mark.slow
@pytest.mark.parametrize("step", STEPS)
def test_products_do_not_grow_in_the_plane_or_in_slabs(step: float):
    few, more = (solved(boxes(n, n, cells=6, held=True), step).products for n in (5, 14))
    assert more <= few + 1
    few, more = (solved(boxes(n, 2, 2, held=True), step).products for n in (8, 54))
    assert more <= few + 3


def test_equal_subdomains_share_factors_turned_and_mirrored_ones_too():
    # Corners, edges, faces and the inside of a cube; by chance equal roundings of zero: up to 27.
    assert solved(boxes(4, 4, 4, held=True)).system.kinds == 4
    assert solved(boxes(4, 4, cells=5, held=True)).system.kinds == 3
    one = solved(boxes(3, 3, 3, held=True), 0.1)
    other = HeatProblem(boxes(3, 3, 3, held=True)[0], MPI.COMM_SELF).solve
    assert one.system.kinds == 4
    assert other().values == pytest.approx(solved(boxes(3, 3, 3, held=True)).values, abs=1e-9)


def test_scenes_that_follow_keep_points_and_rows_while_these_are_the_same():
    low, up = (rectangle((0.0, y), (1.0, y + 1.0), (n, n)) for y, n in ((0.0, 5), (1.0, 4)))
    bodies = {name: ConductingBody(mesh, Conductor(1.0)) for name, mesh in (("low", low), ("up", up))}

    def given(conductance: float, wall: float = 2.0) -> HeatScene:
        """Return a new scene; the wall's vectors are arrays, which do not compare."""
        plane = RigidPlane(np.array([0.0, wall]), np.array([0.0, -1.0]))
        film = ThermalContact(Surface("up", "y0"), Surface("low", "y1"), conductance)
        cooled = ThermalContact(Surface("up", "y1"), plane, GapConductance(1.0, 1.0), 20.0)
        return HeatScene(bodies, [HeldTemperature("low", "y0", 100.0)], contacts=[film, cooled])

    problem = HeatProblem(given(3.0), MPI.COMM_SELF)
    first, same = problem.solve(), problem.solve(replace(problem.scene, held=[*problem.scene.held]))
    assert same.joints.points is first.joints.points
    assert same.torn.B is first.torn.B
    assert same.system.preconditioner is first.system.preconditioner
    for other in (given(30.0), given(30.0, 2.5)):
        state, alone = problem.solve(other), solve_heat(other, MPI.COMM_SELF)
        assert state.torn.B is not same.torn.B
        np.testing.assert_allclose(state.values, alone.values, atol=1e-8)
        np.testing.assert_allclose(state.joints.points.gap, alone.joints.points.gap)
