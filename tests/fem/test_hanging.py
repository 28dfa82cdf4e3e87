"""Bodies of cells of different sizes: even stress stays even, and subdomains and ranks do not matter."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np
import pytest
from mpi4py import MPI

from fenics_contact import Body, Scene, Support, Traction, solve_scene
from fenics_contact.design.adjoint import WeakChoice, linearise_face, solve_adjoint
from fenics_contact.design.objective import Partials
from fenics_contact.gallery import block
from fenics_contact.materials import IsotropicElasticity, NeoHooke, PlaneStrain
from fenics_contact.mesh import bisection_partition, refined
from fenics_contact.results.linear_state import LinearState
from tests.fem import monolithic
from tests.fem.graded import displacement_on, graded, pulled, striped
from tests.fem.several_ranks import displacement_of


@pytest.mark.parametrize("dim", [2, 3])
@pytest.mark.parametrize("cut", ["whole", "bisected", "striped"])
def test_an_even_stress_is_even_across_cells_of_different_sizes(dim: int, cut: str) -> None:
    mesh = graded(dim)
    assert mesh.hanging
    partition = {
        "whole": np.zeros(mesh.n_cells, dtype=int),
        "bisected": bisection_partition(mesh, 6),
        "striped": striped(mesh),
    }[cut]
    scene = pulled(mesh, IsotropicElasticity(100.0, 0.3) if dim == 3 else PlaneStrain(100.0, 0.3))
    state = solve_scene(scene, MPI.COMM_SELF, partitions={"bar": partition}, tolerance=1e-12)
    strains = [0.01, -0.003, -0.003] if dim == 3 else [0.0091, -0.0039]
    exact = mesh.points * strains
    np.testing.assert_allclose(state.gather_displacement("bar"), exact, atol=1e-12 * np.abs(exact).max())
    assert state.torn.decomposition.following is not None
    stress = state.gather_nodal_stress("bar")[0]
    np.testing.assert_allclose(stress, np.broadcast_to(stress[0], stress.shape), atol=1e-10)


@pytest.mark.parametrize("subdomains", [1, 5])
def test_the_displacement_is_that_of_a_monolithic_solve(subdomains: int) -> None:
    """Assembled by dolfinx, hanging nodes eliminated and solved by SciPy."""
    mesh = graded(3)
    body = Body(mesh, IsotropicElasticity(100.0, 0.3))
    scene = Scene({"bar": body}, [Support("bar", "y1")], [Traction("bar", "x1", (0.3, 0.2, 1.0))])
    assert np.isin(mesh.hanging.nodes, mesh.surfaces["y1"]).any()
    partition = bisection_partition(mesh, subdomains)
    state = solve_scene(scene, MPI.COMM_SELF, partitions={"bar": partition}, tolerance=1e-12)
    exact = monolithic.displacement(scene, "bar")
    np.testing.assert_allclose(state.gather_displacement("bar"), exact, atol=1e-10 * np.abs(exact).max())
    # Forces of a support are those of its masters, and balance the load.
    np.testing.assert_allclose(state.reactions()[0].force, [-0.3, -0.2, -1.0], rtol=1e-9)
    assert state.balance().imbalance < 1e-9


def test_adjoints_of_displacements_of_hanging_nodes_are_those_of_their_masters() -> None:
    """The work of the load on the adjoint is the quantity, as all is linear and supports are at rest."""
    mesh = graded(3)
    body = Body(mesh, IsotropicElasticity(100.0, 0.3))
    scene = Scene({"bar": body}, [Support("bar", "x0")], [Traction("bar", "x1", (0.3, 0.2, 1.0))])
    partition = {"bar": bisection_partition(mesh, 5)}
    state = solve_scene(scene, MPI.COMM_SELF, partitions=partition, tolerance=1e-11)
    assert isinstance(state, LinearState)
    moved = state.torn_displacement.reshape(-1, 3)
    hangs = np.isin(np.concatenate([each.mesh.nodes for each in state.torn.subdomains]), mesh.hanging.nodes)
    wanted = np.where(hangs[:, None], [1.0, -2.0, 3.0], 0.0).ravel()
    value = float(wanted @ moved.ravel())
    partials = Partials.of(state, value, by_displacement=wanted)
    adjoint = solve_adjoint(state, partials, linearise_face(state, WeakChoice.RELEASED))
    assert abs(value) > 1e-3
    assert state.torn.load @ adjoint.displacement == pytest.approx(value, rel=1e-7)
    followed = state.torn.decomposition.following @ adjoint.displacement
    np.testing.assert_allclose(adjoint.displacement, followed, atol=1e-9 * np.abs(followed).max())


def test_large_strains_are_even_as_well() -> None:
    mesh = graded(3)
    state = solve_scene(pulled(mesh, NeoHooke(100.0, 0.3), 30.0), MPI.COMM_SELF, tolerance=1e-9)
    plain = block((0.0, 0.0, 0.0), (2.0, 1.0, 1.0), (1, 1, 1))
    known = solve_scene(pulled(plain, NeoHooke(100.0, 0.3), 30.0), MPI.COMM_SELF, tolerance=1e-9)
    stretch = known.gather_displacement("bar").max(axis=0) + known.gather_displacement("bar").min(axis=0)
    exact = mesh.points * (stretch / [2.0, 1.0, 1.0])
    assert stretch[0] > 0.4
    np.testing.assert_allclose(state.gather_displacement("bar"), exact, atol=1e-7)


@pytest.mark.parametrize("ranks", [2, 4])
def test_every_number_of_ranks_has_the_same_answer(ranks: int, mpirun: Callable[..., str]) -> None:
    alone = np.array(displacement_on(MPI.COMM_SELF))
    answer = displacement_of("tests.fem.graded", ranks, mpirun)
    np.testing.assert_allclose(answer, alone, atol=1e-9 * np.abs(alone).max())


def test_subdomains_of_different_density_need_no_more_products_than_even_ones() -> None:
    products = {}
    for name, marks in (("even", slice(0, 0)), ("mixed", slice(None))):
        mesh = block((0.0, 0.0, 0.0), (2.0, 1.0, 1.0), (8, 4, 4))
        if name == "mixed":
            centres = mesh.points[mesh.cells].mean(axis=1)
            mesh = refined(mesh, np.flatnonzero(centres[:, 0] > 1.0)[marks]).mesh
        body = Body(mesh, IsotropicElasticity(100.0, 0.3))
        scene = Scene({"bar": body}, [Support("bar", "x0")], [Traction("bar", "x1", (0.3, 0.2, 1.0))])
        state = solve_scene(
            scene, MPI.COMM_SELF, partitions={"bar": bisection_partition(mesh, 8)}, tolerance=1e-8
        )
        products[name] = state.solution.products
    assert products["mixed"] <= 1.3 * products["even"]
    assert products["even"] > 5
