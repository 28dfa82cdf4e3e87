"""Kernels are what the stiffness does not feel, and K⁺ undoes it up to them."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
import scipy.sparse as sp
from mpi4py import MPI

from fenics_contact import Body, Scene
from fenics_contact.feti import build_torn_system, decompose
from fenics_contact.feti.factor import Factor, fixing_nodes, regularised
from fenics_contact.feti.subdomain import Subdomain
from fenics_contact.gallery import block
from tests.feti.scenes import CELLS, STEEL, Cut, lone_block, ragged_block


def subdomains(cut: Cut) -> tuple[Subdomain, ...]:
    scene, partitions = cut
    return build_torn_system(scene, decompose(scene, partitions, MPI.COMM_SELF)).subdomains


def piece(cell: str, size: tuple[float, float, float], counts: tuple[int, int, int]) -> Subdomain:
    """One block as one subdomain."""
    mesh = block((0, 0, 0), size, counts, cell)
    return subdomains((Scene({"block": Body(mesh, STEEL)}), {"block": np.zeros(mesh.n_cells, dtype=int)}))[0]


@pytest.mark.parametrize("cell", CELLS)
@pytest.mark.parametrize("cut", [lone_block, ragged_block])
def test_kernel_is_annihilated_by_stiffness(cell: str, cut: object) -> None:
    found = subdomains(cut(cell))  # type: ignore[operator]
    assert len(found) > 4
    for subdomain in found:
        stiffness, kernel = subdomain.stiffness, subdomain.kernel
        assert np.linalg.matrix_rank(kernel) == kernel.shape[1] == 6
        assert abs(stiffness @ kernel).max() < 1e-12 * abs(stiffness).max()


@pytest.mark.parametrize("cell", CELLS)
def test_kernel_holds_every_mode_without_energy(cell: str) -> None:
    for subdomain in subdomains(ragged_block(cell)):
        energy = np.linalg.eigvalsh(subdomain.stiffness.toarray())
        assert np.count_nonzero(energy < 1e-10 * energy.max()) == subdomain.kernel.shape[1]
        assert energy.min() > -1e-12 * energy.max()


@pytest.mark.parametrize("cell", CELLS)
@pytest.mark.parametrize(
    ("size", "counts"),
    [((1, 1, 1), (3, 3, 3)), ((1, 1, 30), (1, 1, 30)), ((30, 30, 1), (8, 8, 1)), ((1, 2, 3), (1, 1, 1))],
    ids=["cube", "rod", "plate", "one brick"],
)
def test_the_inverse_of_the_regularised_stiffness_is_a_generalised_inverse(
    cell: str, size: tuple[float, float, float], counts: tuple[int, int, int]
) -> None:
    subdomain = piece(cell, size, counts)
    stiffness = subdomain.stiffness.toarray()
    matrix = regularised(subdomain.stiffness, subdomain.kernel, subdomain.points)
    assert np.linalg.eigvalsh(matrix.toarray()).min() > 0.0
    inverse = Factor(matrix).solve_many(np.eye(len(stiffness)))
    np.testing.assert_allclose(inverse, inverse.T, atol=1e-9 * abs(inverse).max())
    back = stiffness @ inverse @ stiffness
    assert abs(back - stiffness).max() < 1e-9 * abs(stiffness).max()


def test_one_tetrahedron_is_a_subdomain_too() -> None:
    mesh = block((0, 0, 0), (1, 1, 1), (1, 1, 1), "tetrahedron")
    found = subdomains((Scene({"block": Body(mesh, STEEL)}), {"block": np.arange(6)}))
    assert [subdomain.mesh.size for subdomain in found] == [12] * 6
    for subdomain in found:
        matrix = regularised(subdomain.stiffness, subdomain.kernel, subdomain.points)
        assert np.linalg.eigvalsh(matrix.toarray()).min() > 0.0


def test_the_regularised_stiffness_stays_sparse() -> None:
    subdomain = piece("hexahedron", (1, 1, 1), (4, 4, 4))
    matrix = regularised(subdomain.stiffness, subdomain.kernel, subdomain.points)
    assert matrix.nnz < subdomain.stiffness.nnz + 12**2


def test_one_right_side_and_many_have_the_same_solutions() -> None:
    subdomain = piece("hexahedron", (1, 1, 1), (2, 2, 2))
    factor = Factor(regularised(subdomain.stiffness, subdomain.kernel, subdomain.points))
    right = np.random.default_rng(0).standard_normal((factor.size, 3))
    many = factor.solve_many(right)
    for k in range(3):
        one = np.empty(factor.size)
        factor.solve(right[:, k], one)
        np.testing.assert_allclose(many[:, k], one, rtol=1e-10)
    assert factor.solve_many(right[:, :0]).shape == (factor.size, 0)


@pytest.mark.parametrize("counts", [(4, 4, 4), (1, 1, 9), (6, 6, 1)])
def test_fixing_nodes_are_far_apart_and_not_on_a_line(counts: tuple[int, int, int]) -> None:
    points = block((0, 0, 0), counts, counts).points
    chosen = points[fixing_nodes(points)]
    apart = np.linalg.norm(chosen[:, None] - chosen, axis=2)[np.triu_indices(4, 1)]
    assert apart.min() > 0.2 * max(counts)
    assert np.linalg.matrix_rank(chosen - chosen[0]) >= 2


def test_few_nodes_are_all_fixed() -> None:
    assert sorted(fixing_nodes(np.eye(3))) == [0, 1, 2]


def test_the_stiffness_follows_the_material() -> None:
    soft = piece("hexahedron", (1, 1, 1), (1, 1, 1))
    scene = Scene(
        {"block": Body(block((0, 0, 0), (1, 1, 1), (1, 1, 1)), replace(STEEL, young_modulus=420.0))}
    )
    stiff = subdomains((scene, {"block": np.zeros(1, dtype=int)}))[0]
    assert sp.linalg.norm(stiff.stiffness - 2 * soft.stiffness) < 1e-12 * sp.linalg.norm(stiff.stiffness)
