"""What a state says about itself: energies, pressures, statuses, counts."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from mpi4py import MPI

from fenics_contact import Coulomb, Status, Tresca, solve_scene
from fenics_contact.qp import FaceNewton
from fenics_contact.results.deformed_state import AnyState
from fenics_contact.results.dual_solve import contact_result
from fenics_contact.results.forces import nodal_forces
from tests.contact.checks import assert_solved
from tests.contact.gallery import block_on_plane, partitions, pressed_block, two_blocks
from tests.contact.rank_cases import TENSION, uniaxial

TOLERANCE = 1e-9


def solved(scene) -> AnyState:
    state = solve_scene(
        scene, MPI.COMM_SELF, partitions=partitions(scene), solver=FaceNewton(tolerance=TOLERANCE)
    )
    assert_solved(state, TOLERANCE)
    return state


@pytest.mark.parametrize(
    "scene",
    [block_on_plane(Coulomb(0.6)), two_blocks(Tresca(1.0), "tetrahedron"), pressed_block(Coulomb(0.5))],
    ids=["Coulomb", "Tresca", "prescribed displacement"],
)
def test_the_primal_energy_is_the_dual_energy_and_contains_the_friction(scene) -> None:
    state = solved(scene)
    energies = state.energies
    assert energies.primal == pytest.approx(energies.dual, rel=1e-7)
    assert energies.strain > 0.01
    assert energies.friction > 1e-5 * energies.strain
    assert energies.primal == energies.total_potential + energies.friction
    lengths = np.linalg.norm(state.contact.slip, axis=1)
    assert energies.friction == pytest.approx(state.contact.slip_bound @ lengths, rel=1e-12)
    told = dict(line.rsplit(maxsplit=1) for line in str(energies).splitlines())
    assert float(told["total potential"]) == pytest.approx(energies.total_potential, rel=1e-5)
    assert len(told) == 6


def test_pressures_integrate_to_the_load() -> None:
    state = solved(block_on_plane(Coulomb(0.6)))
    contact = state.contact
    assert contact.points.area.sum() == pytest.approx(2.0, rel=1e-2)  # slightly more than the flat face has
    assert contact.pressure @ contact.points.area == pytest.approx(4.0, rel=1e-9)
    assert contact.force.sum(axis=0) == pytest.approx([-2.0, -0.6, 4.0], rel=1e-8)
    assert contact.pressure.max() > 2.0  # the mean


def test_statuses_say_what_forces_and_ways_say() -> None:
    contact = solved(block_on_plane(Coulomb(0.6))).contact
    open_, stick, slip = (contact.status == status for status in (Status.OPEN, Status.STICK, Status.SLIP))
    assert min(open_.sum(), stick.sum(), slip.sum()) > 0
    size, way = contact.normal_force.max(), np.abs(contact.slip).max()
    friction, sliding = np.linalg.norm(contact.friction_force, axis=1), np.linalg.norm(contact.slip, axis=1)
    assert contact.gap[open_].min() > 1e-6 * way
    assert contact.normal_force[open_].max() == 0
    assert np.abs(contact.gap[~open_]).max() < 1e-6 * way
    assert contact.normal_force[~open_].min() > 0
    assert sliding[stick].max() < 1e-6 * way
    assert np.all(friction[stick] < contact.slip_bound[stick])
    assert sliding[slip].min() > 1e-6 * way
    assert friction[slip] == pytest.approx(contact.slip_bound[slip], abs=1e-6 * size)


def test_a_scene_without_contact_is_a_linear_solve() -> None:
    scene = uniaxial("hexahedron")
    state = solve_scene(scene, MPI.COMM_SELF, partitions=partitions(scene), tolerance=1e-10)
    assert_solved(state, TOLERANCE)
    assert state.contact.points.count == 0
    assert state.contact.force.shape == (0, 3)
    assert state.counts["normal_multipliers"] == state.counts["tangential_multipliers"] == 0
    assert state.counts["solver_steps"] <= 2
    assert state.counts["f_products"] < 50
    assert ("1 step, " if state.counts["solver_steps"] == 1 else "2 steps, ") in repr(state)
    assert state.energies.friction == 0
    elongation = state.gather_displacement("bar")[:, 0].max()
    assert state.energies.load == pytest.approx(TENSION * elongation, rel=1e-8)


def test_counts_and_seconds_are_told() -> None:
    state = solved(two_blocks(Coulomb(0.38)))
    counts = state.counts
    assert counts["subdomains"] == 4
    assert counts["torn_unknowns"] == sum(s.mesh.size for s in state.system.torn.subdomains)
    assert counts["normal_multipliers"] == 35
    assert counts["tangential_multipliers"] == 70
    assert 10 < counts["f_products"] < 300
    assert counts["f_products"] <= state.system.products
    assert counts["solver_steps"] == len(state.solution.history) > 1
    assert {"decompose", "assemble", "factor", "solve", "state"} <= set(state.seconds)
    assert all(seconds >= 0 for seconds in state.seconds.values())


def test_places_of_contact_points_are_those_of_their_slave_nodes() -> None:
    state = solved(two_blocks(Coulomb(0.38)))
    slave = state.scene.contacts[0].slave
    mesh = state.scene.bodies[slave.body].mesh
    wanted = mesh.points[np.unique(mesh.surfaces[slave.name])]
    places = state.contact_places
    assert places.shape == (state.contact.points.count, 3)
    assert len(wanted) == len(places) > 10
    np.testing.assert_array_equal(np.unique(places, axis=0), np.unique(wanted, axis=0))


def test_forces_are_never_below_zero_whatever_the_tolerance_leaves_and_still_balance() -> None:
    state = solved(block_on_plane(Coulomb(0.6)))
    torn, multiplier = state.torn, state.solution.multiplier.copy()
    ways = np.where(state.contact.status == Status.OPEN, state.contact.gap, np.inf)
    opened = np.sort(np.argsort(-np.where(np.isfinite(ways), ways, -1.0))[:2])
    rows = np.searchsorted(torn.numbering.owned, torn.normal_rows[opened])
    multiplier[rows] = [-7e-4, 1e-6]
    unclean = replace(state.rows, multiplier=multiplier)
    contact = contact_result(state.torn, unclean, state.torn_displacement)
    assert contact.normal_force.min() == 0.0
    assert np.array_equal(contact.normal_force > 0.0, contact.status != Status.OPEN)
    acting = nodal_forces(state.torn, multiplier, state.torn_displacement).contact
    left = np.einsum("nd,nd->n", (acting - contact.force)[opened], contact.points.normal[opened])
    assert left == pytest.approx([-7e-4, 1e-6], rel=1e-9)


def test_no_attribute_of_a_state_solves_anything() -> None:
    state = solved(block_on_plane(Coulomb(0.6)))
    before = state.system.products
    names = [name for name in dir(type(state)) if not name.startswith("_")]
    assert len([getattr(state, name) for name in names]) > 20
    assert state.system.products == before
    assert state.estimate_errors(geometry=False) is state.known_errors
    assert state.system.products == before + 1
