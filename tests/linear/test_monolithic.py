"""Without contact, Total FETI finds the displacement that one big direct solve finds."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from mpi4py import MPI

from fenics_contact import Support, solve_scene
from fenics_contact._equilibrium.problem import default_solver
from fenics_contact.mesh import bisection_partition
from fenics_contact.qp import FaceNewton, ProjectedCG, Smalse
from tests.feti.scenes import CELLS
from tests.linear.scenes import BOXES, TOLERANCE, cut, error, loaded_block, two_materials


@pytest.mark.parametrize("cell", CELLS)
@pytest.mark.parametrize("subdomains", BOXES)
def test_the_displacement_is_that_of_a_monolithic_solve(cell: str, subdomains: int) -> None:
    scene = loaded_block(cell)
    state = solve_scene(scene, MPI.COMM_SELF, partitions=cut(scene, subdomains), tolerance=1e-10)
    assert state.counts["subdomains"] == subdomains
    assert error(state, "block") < TOLERANCE


@pytest.mark.parametrize("cell", CELLS)
def test_ragged_subdomains_find_it_too(cell: str) -> None:
    scene = loaded_block(cell)
    state = solve_scene(
        scene,
        MPI.COMM_SELF,
        partitions={"block": bisection_partition(scene.bodies["block"].mesh, 11)},
        tolerance=1e-10,
    )
    assert error(state, "block") < TOLERANCE


def test_prescribed_displacements_are_met() -> None:
    given = (0.01, -0.02, 0.05)
    scene = loaded_block("hexahedron", given)
    state = solve_scene(scene, MPI.COMM_SELF, partitions=cut(scene, 8), tolerance=1e-10)
    assert error(state, "block") < TOLERANCE
    held = np.unique(scene.bodies["block"].mesh.surfaces["z0"])
    u = state.gather_displacement("block")[held]
    np.testing.assert_allclose(u, np.tile(given, (len(held), 1)), atol=1e-10)


@pytest.mark.parametrize("cell", CELLS)
def test_components_that_are_not_prescribed_stay_free(cell: str) -> None:
    scene = loaded_block(cell, (None, 0.0, 0.1))
    scene = replace(scene, supports=[*scene.supports, Support("block", "x0", (0.02, None, None))])
    state = solve_scene(scene, MPI.COMM_SELF, partitions=cut(scene, 8), tolerance=1e-10)
    assert error(state, "block") < TOLERANCE
    u = state.gather_displacement("block")
    surfaces = scene.bodies["block"].mesh.surfaces
    below, left = np.unique(surfaces["z0"]), np.unique(surfaces["x0"])
    np.testing.assert_allclose(u[below][:, 1:], np.tile([0.0, 0.1], (len(below), 1)), atol=1e-10)
    np.testing.assert_allclose(u[left][:, 0], 0.02, atol=1e-10)
    assert np.ptp(u[below][:, 0]) > 1e-4


def test_bodies_of_different_materials_and_cells_do_not_disturb_each_other() -> None:
    scene, partitions = two_materials()
    state = solve_scene(scene, MPI.COMM_SELF, partitions=partitions, tolerance=1e-10)
    assert error(state, "soft") < TOLERANCE
    assert error(state, "stiff") < TOLERANCE


def test_a_scene_without_contact_is_solved_by_conjugate_gradients_alone() -> None:
    scene = loaded_block("hexahedron")
    state = solve_scene(scene, MPI.COMM_SELF, partitions=cut(scene, 8), tolerance=1e-10)
    assert state.counts["normal_multipliers"] == state.counts["tangential_multipliers"] == 0
    assert isinstance(default_solver(state.system.torn), ProjectedCG)
    assert state.solution.iterations == 1, "one linear solve is enough"
    assert state.solution.residuals.gluing < 1e-10
    assert state.contact.points.count == 0
    assert len(state.contact.normal_force) == len(state.contact.status) == 0


@pytest.mark.parametrize("solver", [FaceNewton(tolerance=1e-9), Smalse(tolerance=1e-6)])
def test_contact_solvers_take_a_scene_without_contact(solver: FaceNewton | Smalse) -> None:
    scene = loaded_block("hexahedron")
    state = solve_scene(scene, MPI.COMM_SELF, partitions=cut(scene, 4), solver=solver)
    assert error(state, "block") < 100 * solver.tolerance


def test_primal_and_dual_energy_agree() -> None:
    scene, partitions = two_materials()
    energies = solve_scene(scene, MPI.COMM_SELF, partitions=partitions, tolerance=1e-10).energies
    assert energies.friction == 0.0
    assert energies.primal == pytest.approx(energies.dual, rel=1e-9)
    assert energies.strain > 0.01


def test_one_subdomain_is_a_decomposition_too() -> None:
    scene = loaded_block("hexahedron")
    whole = {"block": np.zeros(scene.bodies["block"].mesh.n_cells, dtype=int)}
    assert error(solve_scene(scene, MPI.COMM_SELF, partitions=whole, tolerance=1e-10), "block") < TOLERANCE
