"""What a dual system needs besides the operators of its subdomains, counted in bytes."""

from __future__ import annotations

import tracemalloc

import numpy as np
import pytest
import scipy.sparse as sp
from mpi4py import MPI

from benchmarks.cases.scenes import block_mesh, block_on_plane
from fenics_contact import BodyMesh, box_partition
from fenics_contact._surfaces.facets import faceted_surface
from fenics_contact._surfaces.true_surface import reconstructed
from fenics_contact.feti import DualSystem, build_torn_system, decompose
from fenics_contact.feti.decomposition import tear
from fenics_contact.mesh.faces import boundary_faces, neighbours
from fenics_contact.mesh.quality import cell_volumes, thickness
from fenics_contact.qp import FaceNewton
from fenics_contact.qp.coarse import DenseSquareInverse, GramInverse
from fenics_contact.results.dual_solve import solve_dual


@pytest.fixture(scope="module")
def system() -> DualSystem:
    mesh = block_mesh((15, 8, 7))
    scene, parts = block_on_plane(mesh, 0.3), {"block": box_partition(mesh, (5, 2, 2))}
    return DualSystem(build_torn_system(scene, decompose(scene, parts, MPI.COMM_SELF)))


def traced(call: object, *arguments: object) -> int:
    """Return the largest number of bytes that a call holds in arrays."""
    tracemalloc.start()
    call(*arguments)  # type: ignore[operator]
    peak = tracemalloc.get_traced_memory()[1]
    tracemalloc.stop()
    return peak


def test_modes_are_those_of_the_subdomains_and_not_copied(system: DualSystem) -> None:
    subdomains = system.torn.subdomains
    assert len(subdomains) == 20
    assert all(part is own.kernel for part, own in zip(system.kernel.parts, subdomains, strict=True))
    assert system.kernel.coefficients.data.nbytes < 0.1 * sum(part.nbytes for part in system.kernel.parts)


def test_products_with_modes_are_those_of_their_matrix(system: DualSystem) -> None:
    modes, B = system.kernel, system.torn.B
    R = sp.block_diag(modes.parts).toarray() @ modes.coefficients.toarray()
    assert modes.shape == R.shape == (system.torn.decomposition.torn_size, system.problem.coarse.m)
    rng = np.random.default_rng(0)
    alpha, force = rng.normal(size=R.shape[1]), rng.normal(size=R.shape[0])
    np.testing.assert_allclose(modes @ alpha, R @ alpha, atol=1e-12)
    np.testing.assert_allclose(modes.resultants(force), R.T @ force, atol=1e-11)
    np.testing.assert_allclose(modes.tocsr().toarray(), R, atol=1e-13)
    np.testing.assert_allclose(modes.moved_by(B).toarray(), B @ R, atol=1e-12)
    turn = sp.random(R.shape[1], 3, 0.2, random_state=rng, format="csr")
    np.testing.assert_allclose(modes.combined(turn).tocsr().toarray(), R @ turn.toarray(), atol=1e-13)


def test_transposed_matrices_share_the_memory_of_what_they_transpose(system: DualSystem) -> None:
    coarse, preconditioner = system.problem.coarse, system.preconditioner
    pairs = (
        (system._B, system._Bt),
        (system._B_interface, system._Bt_interface),
        (preconditioner._B, preconditioner._Bt),
        (coarse.matrix, coarse._transposed),
    )
    for matrix, transposed in pairs:
        assert matrix.nnz > 0
        assert np.shares_memory(matrix.data, transposed.data)
        assert np.shares_memory(matrix.indices, transposed.indices)


def test_rows_on_the_interface_share_the_values_of_all(system: DualSystem) -> None:
    assert np.shares_memory(system._B_interface.data, system.torn.B.data)
    assert abs(system._B_interface - system.torn.B[:, system.inverse.interface]).max() == 0.0
    data = system.problem.coarse.matrix.data  # has no room for zeros
    assert data.base is None or data.base.nbytes == data.nbytes


def test_the_coarse_space_needs_few_bytes_a_torn_unknown_while_it_is_built(system: DualSystem) -> None:
    size = system.torn.decomposition.torn_size
    assert traced(system._kernel, MPI.COMM_SELF) < 100 * size
    assert traced(system._coarse_columns) < 400 * size


def test_the_solution_needs_few_vectors_besides_those_of_its_krylov_space(system: DualSystem) -> None:
    peak = traced(solve_dual, system, FaceNewton(tolerance=1e-8))
    assert peak < 150 * 8 * system.torn.numbering.total


@pytest.fixture(scope="module")
def fine() -> BodyMesh:
    return block_mesh((40, 24, 12))


def test_what_every_rank_does_with_the_whole_mesh_takes_little_beside_it(fine: BodyMesh) -> None:
    whole = fine.points.nbytes + fine.cells.nbytes
    assert traced(cell_volumes, fine.points, fine.cells) < 2.0 * whole
    assert traced(thickness, fine.points, fine.cells) < 3.0 * whole
    assert traced(neighbours, fine.cells) < 5.0 * whole
    assert traced(boundary_faces, fine.cells) < 5.0 * whole
    parts = {"block": box_partition(fine, (10, 6, 3))}
    assert traced(tear, block_on_plane(fine), parts, 4, {"block": np.ones(fine.n_cells)}) < 2.0 * whole


def test_the_true_surface_of_many_facets_is_fitted_in_parts(fine: BodyMesh) -> None:
    facets = fine.surfaces["z0"]
    assert traced(reconstructed, faceted_surface(fine.points, facets)) < 5000 * len(facets)


def test_dense_coarse_matrices_are_factored_in_one_copy() -> None:
    matrix = np.eye(400) + 1e-3
    assert traced(GramInverse, matrix) < 1.2 * matrix.nbytes
    assert traced(DenseSquareInverse, matrix, np.ones(400)) < 1.2 * matrix.nbytes
    found = GramInverse(matrix).solve(matrix[:, 7])
    np.testing.assert_allclose(found, np.eye(400)[7], atol=1e-14)
