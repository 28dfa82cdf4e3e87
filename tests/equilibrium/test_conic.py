"""Tresca and frictionless scenes against a conic solver that knows nothing of subdomains."""

from __future__ import annotations

from functools import cache

import numpy as np
import pytest
from mpi4py import MPI

from fenics_contact import Scene, Status, Tresca, solve_scene
from fenics_contact.qp import DualSolver, FaceNewton, Smalse
from fenics_contact.results.deformed_state import AnyState
from tests.equilibrium.checks import assert_solved, body_displacements
from tests.equilibrium.conic_reference import ConicReference, ConicSolution
from tests.scenes import block_on_plane, guided, partitions, pressed_block, two_blocks

TOLERANCE = 1e-9
CELLS = ["hexahedron", "tetrahedron"]
SOLVERS = {"face Newton": FaceNewton(tolerance=TOLERANCE), "SMALSE": Smalse(tolerance=TOLERANCE)}
SCENES = {
    "block on plane, Tresca": lambda cell: block_on_plane(Tresca(1.6), cell),
    "two blocks, Tresca": lambda cell: two_blocks(Tresca(1.0), cell),
    "pressed block, Tresca": lambda cell: pressed_block(Tresca(0.5), cell),
    "block on plane, frictionless": lambda cell: guided(block_on_plane(None, cell), "block"),
    "two blocks, frictionless": lambda cell: guided(two_blocks(None, cell), "upper"),
    "pressed block, frictionless": lambda cell: pressed_block(None, cell),
}


@cache
def problem(name: str, cell: str) -> tuple[Scene, ConicReference, ConicSolution]:
    scene = SCENES[name](cell)
    reference = ConicReference(scene)
    return scene, reference, reference.solve()


def solved(scene: Scene, solver: DualSolver) -> AnyState:
    return solve_scene(scene, MPI.COMM_SELF, partitions=partitions(scene), solver=solver)


@pytest.mark.parametrize("solver", SOLVERS)
@pytest.mark.parametrize("cell", CELLS)
@pytest.mark.parametrize("name", SCENES)
def test_energies_and_contact_forces_equal_those_of_a_conic_solver(name: str, cell: str, solver: str) -> None:
    scene, reference, expected = problem(name, cell)
    state = solved(scene, SOLVERS[solver])
    assert_solved(state, TOLERANCE)

    statuses = [state.contact.count(status) for status in Status]
    assert statuses[Status.OPEN] > 0
    assert statuses[Status.SLIP] > 0
    assert (statuses[Status.STICK] > 0) == ("Tresca" in name)

    assert abs(expected.primal) > 0.01
    assert state.energies.primal == pytest.approx(expected.primal, rel=1e-6)
    assert state.energies.dual == pytest.approx(expected.dual, rel=1e-6)
    assert np.array_equal(state.contact.points.slave, reference.rows.slave)
    size = np.abs(expected.contact_force).max()
    assert np.abs(state.contact.force - expected.contact_force).max() < 1e-6 * size
    assert np.abs(state.contact.normal_force - expected.normal_force).max() < 1e-6 * size
    way = np.abs(expected.displacement).max()
    assert np.abs(body_displacements(state) - expected.displacement).max() < 1e-6 * way


@pytest.mark.parametrize("solver", SOLVERS)
def test_a_body_that_nothing_keeps_from_sliding_is_solved_if_nothing_pushes_it(solver: str) -> None:
    scene = block_on_plane(None, push=0.0)
    expected, state = ConicReference(scene).solve(), solved(scene, SOLVERS[solver])
    assert_solved(state, TOLERANCE)
    assert state.energies.primal == pytest.approx(expected.primal, rel=1e-6)
    size = np.abs(expected.contact_force).max()
    assert np.abs(state.contact.force - expected.contact_force).max() < 1e-6 * size
    assert state.contact.force.sum(axis=0) == pytest.approx([0, 0, 4], abs=1e-8)


@pytest.mark.parametrize("cell", CELLS)
def test_the_reference_itself_is_in_equilibrium(cell: str) -> None:
    _, reference, expected = problem("two blocks, Tresca", cell)
    reaction = reference.reaction(expected.displacement)
    held = ~np.isnan(reference.prescribed).reshape(-1, 3)
    contact = np.zeros_like(reaction)
    contact[reference.rows.slave] = expected.contact_force
    upper = slice(reference.offset["upper"], None)
    assert np.abs(expected.contact_force).max() > 0.05
    assert held.any()
    assert np.abs(reaction - contact)[upper].max() < 1e-8
    load = reference.f.reshape(-1, 3).sum(axis=0)
    assert reaction.sum(axis=0) == pytest.approx(-load, rel=1e-8)
    assert expected.primal == pytest.approx(expected.dual, rel=1e-9)


def test_the_reference_depends_on_the_slip_bound() -> None:
    _, reference, expected = problem("two blocks, Tresca", "hexahedron")
    changed = reference.solve(1.1 * reference.rows.bound)
    assert abs(changed.primal - expected.primal) > 1e-4 * abs(expected.primal)
