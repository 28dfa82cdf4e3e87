"""The operators of the dual problem are what their formulas say."""

from __future__ import annotations

from itertools import pairwise

import numpy as np
import pytest
import scipy.linalg
import scipy.sparse as sp
from mpi4py import MPI

from fenics_contact import Body, ContactPair, Coulomb, RigidPlane, Scene, Support, Surface, box_partition
from fenics_contact.feti import DualSystem, build_torn_system, decompose
from fenics_contact.feti.contact_block import REGULARISATION
from fenics_contact.feti.inverse import LocalKind
from fenics_contact.feti.kernel_basis import whole_motions
from fenics_contact.gallery import block
from tests.feti.scenes import CELLS, STEEL, Cut, clamped_block, lone_block, ragged_block, touching_blocks

#: How close the preconditioner comes to its formula: explicit Schur complements are in single precision.
ROUNDING = {LocalKind.IMPLICIT: 1e-11, LocalKind.EXPLICIT: 1e-6}


def dual(cut: Cut, kind: LocalKind = LocalKind.AUTOMATIC) -> DualSystem:
    scene, partitions = cut
    return DualSystem(build_torn_system(scene, decompose(scene, partitions, MPI.COMM_SELF)), kind=kind)


SCENES = {
    "hexahedra": lambda: clamped_block("hexahedron"),
    "tetrahedra": lambda: clamped_block("tetrahedron"),
    "free and ragged": lambda: ragged_block("tetrahedron"),
    "contact": touching_blocks,
}


@pytest.fixture(scope="module", params=list(ROUNDING), ids=lambda kind: kind.value)
def kind(request: pytest.FixtureRequest) -> LocalKind:
    return LocalKind(request.param)


@pytest.fixture(scope="module", params=list(SCENES))
def system(request: pytest.FixtureRequest, kind: LocalKind) -> DualSystem:
    return dual(SCENES[request.param](), kind)


def dense(system: DualSystem, operator: object) -> np.ndarray:
    identity = np.eye(system.torn.numbering.total)
    return np.column_stack([operator(column) for column in identity])  # type: ignore[operator]


def test_the_dual_operator_is_b_times_inverse_times_b_transposed(system: DualSystem) -> None:
    B = system.torn.B.toarray()
    inverse = np.column_stack([system.inverse(column) for column in np.eye(B.shape[1])])
    expected = B @ inverse @ B.T
    F = dense(system, system.apply)
    assert np.abs(F - expected).max() < 1e-9 * np.abs(expected).max()


def test_the_dual_operator_is_symmetric_and_positive_semidefinite(system: DualSystem) -> None:
    F = dense(system, system.apply)
    size = np.abs(F).max()
    assert np.abs(F - F.T).max() < 1e-11 * size
    assert np.linalg.eigvalsh(0.5 * (F + F.T)).min() > -1e-11 * size
    assert size > 0


def test_columns_of_g_are_the_resultants_of_the_multipliers(system: DualSystem) -> None:
    torn = system.torn
    R = system.kernel.tocsr().toarray()
    G = system.problem.coarse.matrix.toarray()
    assert G.shape == (6 * len(torn.subdomains) - system.unheld.shape[1], torn.numbering.total)
    np.testing.assert_allclose(G, R.T @ torn.B.toarray().T, atol=1e-13)
    np.testing.assert_allclose(system.problem.coarse.load, R.T @ torn.load, atol=1e-12)


def test_the_kernel_spans_the_motions_of_all_subdomains(system: DualSystem) -> None:
    own = sp.block_diag([subdomain.kernel for subdomain in system.torn.subdomains]).toarray()
    kernel = np.hstack([system.kernel.tocsr().toarray(), system.unheld.toarray()])
    coefficients, _, rank, _ = np.linalg.lstsq(own, kernel, rcond=None)
    np.testing.assert_allclose(own @ coefficients, kernel, atol=1e-13)
    assert rank == kernel.shape[1]
    assert np.linalg.cond(coefficients) < 1e3


def test_motions_that_no_row_feels_are_none_of_the_unknowns(system: DualSystem) -> None:
    scene = system.torn.scene
    free = not (scene.supports or scene.contacts)
    assert system.unheld.shape[1] == (6 * len(scene.bodies) if free else 0)
    assert np.abs(system.torn.B @ system.unheld.toarray()).max(initial=0.0) < 1e-12


def all_resultants(system: DualSystem) -> sp.csr_matrix:
    """Return the columns of G with those of motions that no row feels, all of them rounding."""
    return sp.csr_matrix(system._kernel(system.torn.numbering.comm).moved_by(system.torn.B).T)


def test_gluing_rows_do_not_feel_the_motions_of_whole_bodies(system: DualSystem) -> None:
    torn, G = system.torn, all_resultants(system)
    G.data[np.abs(G.data) < 1e-12] = 0.0
    G.eliminate_zeros()
    cut = 0
    for start, end in pairwise(torn.decomposition.tearing.subdomain_offset):
        if end - start < 2:
            continue
        cut += 1
        rows = G[6 * start : 6 * start + 6].tocoo()
        supported = np.unique(torn.B[: torn.n_gluing].nonzero()[0])
        couples = np.diff(torn.B[supported].indptr) > 1
        glued = supported[couples]
        assert glued.size
        assert not np.isin(rows.col, glued).any()
        assert (rows.nnz > 0) == bool(torn.scene.supports or torn.scene.contacts)
    assert cut


def test_a_gluing_multiplier_moves_only_the_subdomains_that_it_couples(system: DualSystem) -> None:
    modes = np.arange(0, 6 * len(system.torn.subdomains) + 1, 6)
    own_basis = np.linalg.inv(whole_motions(system.torn, modes).toarray())
    G = own_basis.T @ all_resultants(system).toarray()
    G = G.reshape(len(system.torn.subdomains), 6, -1)
    touched = (np.abs(G).max(axis=1) > 1e-12).sum(axis=0)
    B = system.torn.B
    owner = np.repeat(np.arange(len(system.torn.subdomains)), [s.mesh.size for s in system.torn.subdomains])
    coupled = [len(set(owner[B.indices[B.indptr[row] : B.indptr[row + 1]]])) for row in range(B.shape[0])]
    np.testing.assert_array_equal(touched, coupled)
    assert max(coupled[: system.torn.n_equality]) > 1


def test_the_right_side_is_the_jump_of_the_loaded_subdomains(system: DualSystem) -> None:
    torn = system.torn
    expected = torn.B @ system.inverse(torn.load) - torn.right
    np.testing.assert_allclose(system.problem.rhs, expected, atol=1e-13 * max(np.abs(expected).max(), 1e-3))


def test_the_preconditioner_is_symmetric_and_positive_in_equilibrium(
    system: DualSystem, kind: LocalKind
) -> None:
    assert system.problem.preconditioner is not None
    M = dense(system, system.problem.preconditioner)
    size = np.abs(M).max()
    assert np.abs(M - M.T).max() < ROUNDING[kind] * size
    basis = scipy.linalg.null_space(system.problem.coarse.matrix.toarray())
    assert 0 < basis.shape[1] < len(M)
    assert np.linalg.eigvalsh(basis.T @ M @ basis).min() > 1e-6 * size


def test_the_preconditioner_is_the_schur_complement_of_sewn_jumps(
    system: DualSystem, kind: LocalKind
) -> None:
    B, n = system.torn.B.toarray(), system.torn.n_equality
    touched = np.abs(B).sum(axis=0) > 0
    S = np.zeros((B.shape[1],) * 2)
    softness = np.zeros(B.shape[1])
    start = 0
    for subdomain in system.torn.subdomains:
        here = np.arange(start, start + subdomain.mesh.size)
        K = subdomain.stiffness.toarray()
        b, i = touched[here], ~touched[here]
        inner = K[np.ix_(b, i)] @ np.linalg.solve(K[np.ix_(i, i)], K[np.ix_(i, b)]) if i.any() else 0.0
        S[np.ix_(here[b], here[b])] = K[np.ix_(b, b)] - inner
        start += subdomain.mesh.size
    decomposition = system.torn.decomposition
    softness.reshape(-1, 3)[decomposition.held[1]] = 1.0 / decomposition.tearing.copy_stiffness[:, None]
    weighted = B * softness
    gram = weighted @ B.T
    gram[n:, n:] += REGULARISATION * np.diag(np.diag(gram[n:, n:]))
    scale = scipy.linalg.block_diag(np.diag(1.0 / np.diag(gram)[:n]), np.linalg.inv(gram[n:, n:]))
    lifted, b = weighted.T @ scale, system.inverse.interface
    lifted[b] = np.column_stack([system.preconditioner._sewing.eased(column) for column in lifted[b].T])
    expected = lifted.T @ S @ lifted
    assert system.problem.preconditioner is not None
    M = dense(system, system.problem.preconditioner)
    assert np.abs(M - expected).max() < 10 * ROUNDING[kind] * np.abs(expected).max()


def test_nodes_with_more_rows_than_displacements_leave_the_preconditioner_bounded() -> None:
    cube, law = block((0, 0, 0), (1, 1, 1), (2, 2, 2)), Coulomb(0.3)
    walls = [("x0", (1, 0, 0)), ("y0", (0, 1, 0)), ("z0", (0, 0, 1))]
    pairs = [ContactPair(Surface("cube", side), RigidPlane((0, 0, 0), normal), law) for side, normal in walls]
    scene = Scene({"cube": Body(cube, STEEL)}, contacts=pairs)
    system = dual((scene, {"cube": box_partition(cube, (2, 1, 1))}))
    contact = system.torn.B[system.torn.n_equality :]
    assert np.linalg.matrix_rank(contact.toarray()) < contact.shape[0] - 20
    assert system.problem.preconditioner is not None
    M = dense(system, system.problem.preconditioner)
    stiffest = max(abs(subdomain.stiffness).max() for subdomain in system.torn.subdomains)
    assert np.abs(M).max() < 3 * stiffest
    assert np.abs(M - M.T).max() < ROUNDING[LocalKind.EXPLICIT] * stiffest


@pytest.mark.parametrize("cell", CELLS)
def test_the_preconditioner_makes_the_operator_well_conditioned(cell: str) -> None:
    system = dual(clamped_block(cell, layers=3))
    assert system.problem.preconditioner is not None
    project = system.problem.coarse.project
    F, M, P = (dense(system, op) for op in (system.apply, system.problem.preconditioner, project))

    def condition(matrix: np.ndarray) -> float:
        values = np.linalg.eigvals(matrix).real
        values = values[values > 1e-8 * values.max()]
        return float(values.max() / values.min())

    assert condition(P @ M @ P @ F @ P) < 0.2 * condition(P @ F @ P)


def test_the_diagonal_is_that_of_the_operator_on_contact_rows() -> None:
    system = dual(touching_blocks())
    F, contact = dense(system, system.apply), np.arange(system.torn.n_equality, system.torn.numbering.total)
    np.testing.assert_allclose(system.problem.diagonal[contact], np.diag(F)[contact], rtol=1e-9)
    assert len(contact) > 50
    np.testing.assert_array_equal(system.problem.diagonal[: system.torn.n_equality], 1.0)


def test_contact_rows_that_no_multiplier_moves_are_marked() -> None:
    system = dual(
        lone_block(
            "hexahedron",
            supports=[Support("block", "x0", (0.1, 0.0, None))],
            contacts=[ContactPair(Surface("block", "z0"), RigidPlane((0, 0, -0.2), (0, 0, 1)), Coulomb(0.3))],
        )
    )
    still = np.abs(dense(system, system.apply)).max(axis=1) < 1e-14
    still[: system.torn.n_equality] = False
    assert still.sum() == 10  # the slips of five points
    np.testing.assert_array_equal(system.problem.between_supports, still)


def test_displacements_of_any_multiplier_obey_equilibrium_in_every_subdomain() -> None:
    system = dual(clamped_block("hexahedron"))
    problem = system.problem
    multiplier = problem.coarse.particular() + problem.coarse.project(
        np.random.default_rng(4).standard_normal(problem.layout.size)
    )
    alpha = np.random.default_rng(5).standard_normal(problem.coarse.m)
    u = system.displacement(multiplier, alpha)
    K = sp.block_diag([subdomain.stiffness for subdomain in system.torn.subdomains], format="csr")
    right = system.torn.load - system.force(multiplier)
    assert np.abs(K @ u - right).max() < 1e-9 * np.abs(right).max()
    violation = system.jump(u) - system.torn.right
    flexed = system.apply(multiplier) - problem.rhs - problem.coarse.transpose(alpha)
    np.testing.assert_allclose(-violation, flexed, atol=1e-10 * np.abs(violation).max())


def test_contact_and_frictional_multipliers_have_their_places_in_the_layout() -> None:
    system = dual(touching_blocks())
    layout, torn = system.problem.layout, system.torn
    np.testing.assert_array_equal(layout.normal, torn.normal_rows)
    np.testing.assert_array_equal(layout.tangential, torn.tangential_rows)
    np.testing.assert_array_equal(layout.friction_of, torn.frictional)
    np.testing.assert_array_equal(system.torn.owned_discs, np.arange(len(torn.frictional)))
