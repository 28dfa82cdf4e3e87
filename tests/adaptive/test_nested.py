"""States on halved meshes by nested iteration: the answer of a cold solve, in fewer products."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace

import numpy as np
import pytest
from mpi4py import MPI

from fenics_contact import LinearState, Scene, ToolMotion, solve_nested, solve_scene
from fenics_contact.errors import InvalidInputError, UserCodeError
from fenics_contact.materials import NeoHooke
from tests.equilibrium.nested_cases import disc_on_block, two_plates
from tests.equilibrium.tooling import STRAIGHT, pressed

SELF = MPI.COMM_SELF
RANKS = """
from mpi4py import MPI
from fenics_contact import solve_nested
from tests.equilibrium.nested_cases import disc_on_block
states = []
state = solve_nested(disc_on_block(cells=2), 2, MPI.COMM_WORLD, tolerance=1e-8, callback=states.append)
if MPI.COMM_WORLD.rank == 0:
    print(len(states), state.torn.decomposition.tearing.n_subdomains, repr(state.energies.strain))
"""


@pytest.fixture(scope="module")
def states() -> list[LinearState]:
    """The states on all meshes of a disc that is pushed onto a block with friction, the finest last."""
    found: list[LinearState] = []
    last = solve_nested(disc_on_block(cells=4), 2, SELF, tolerance=1e-8, callback=found.append)
    assert last is found[-1]
    return found


@pytest.fixture(scope="module")
def cold(states: list[LinearState]) -> LinearState:
    state = solve_scene(states[-1].scene, SELF, tolerance=1e-8)
    assert isinstance(state, LinearState)
    return state


def test_all_cells_are_halved(states: list[LinearState]) -> None:
    cells = [{name: body.mesh.n_cells for name, body in each.scene.bodies.items()} for each in states]
    assert cells[1:] == [{name: 4 * count for name, count in before.items()} for before in cells[:-1]]


def test_the_answer_is_that_of_a_cold_solve(states: list[LinearState], cold: LinearState) -> None:
    assert np.count_nonzero(cold.contact.normal_force) > 10
    for body in cold.scene.bodies:
        one, other = (state.gather_displacement(body) for state in (cold, states[-1]))
        np.testing.assert_allclose(other, one, rtol=0, atol=1e-7 * np.abs(one).max())
    np.testing.assert_array_equal(states[-1].contact.status, cold.contact.status)


def test_coarse_meshes_are_solved_roughly_and_the_last_takes_fewer_products(
    states: list[LinearState], cold: LinearState
) -> None:
    *coarse, last = states
    assert [state.tolerance for state in states] == [0.1, 0.1, 1e-8]
    assert min(state.solution.residuals.worst for state in coarse) > 1e-4
    assert sum(state.solution.products for state in coarse) <= 15
    assert last.solution.products <= 0.75 * cold.solution.products


def test_without_halvings_it_is_the_state_of_the_scene() -> None:
    scene = disc_on_block(cells=2)
    state = solve_nested(scene, 0, SELF, tolerance=1e-8)
    assert state.scene is scene
    assert state.energies.strain == solve_scene(scene, SELF, tolerance=1e-8).energies.strain


def test_bodies_that_carry_the_motions_of_tools_stay_as_they_are() -> None:
    scene = pressed(ToolMotion("left", (0.0, 0.0, -0.05), STRAIGHT), friction=0.2)
    state = solve_nested(scene, 1, SELF, tolerance=1e-8)
    kept = set(scene.bodies) - set(scene.deforming)
    assert kept
    assert all(state.scene.bodies[name].mesh is scene.bodies[name].mesh for name in kept)
    cold = solve_scene(state.scene, SELF, tolerance=1e-8)
    assert state.energies.strain == pytest.approx(cold.energies.strain, rel=1e-6)


@pytest.mark.parametrize("ranks", [2, 4])
def test_ranks_find_the_same_state(ranks: int, mpirun: Callable[..., str]) -> None:
    one, several = (np.array(mpirun(RANKS, count).split(), dtype=float) for count in (1, ranks))
    assert one[0] == several[0] == 3
    assert one[2] == pytest.approx(several[2], rel=1e-6)


def test_what_cannot_be_nested_is_refused() -> None:
    scene = disc_on_block(cells=2)
    with pytest.raises(InvalidInputError, match="halvings must be an integer of at least 0, got -1"):
        solve_nested(scene, -1, SELF)
    for wrong in (0.0, 1.0):
        with pytest.raises(InvalidInputError, match="coarse_tolerance must lie between 0 and 1, got"):
            solve_nested(scene, 1, SELF, coarse_tolerance=wrong)
    with pytest.raises(InvalidInputError, match="coarse_tolerance must be a finite number"):
        solve_nested(scene, 1, SELF, coarse_tolerance=float("nan"))
    rubber = {name: replace(body, material=NeoHooke(1.0, 0.3)) for name, body in two_plates().items()}
    with pytest.raises(InvalidInputError, match="coarser meshes start finer ones where all materials are"):
        solve_nested(Scene(rubber), 1, SELF)


def test_errors_of_the_callback_are_named() -> None:
    def fails(state: LinearState) -> None:
        raise KeyError(state)

    with pytest.raises(UserCodeError, match="the callback of meshes failed with KeyError"):
        solve_nested(disc_on_block(cells=2), 1, SELF, callback=fails)
