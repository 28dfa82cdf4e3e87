from __future__ import annotations

import numpy as np
import pytest
import scipy.sparse as sp
from mpi4py import MPI

from fenics_contact.errors import InvalidInputError
from fenics_contact.qp import coarse as coarse_module
from fenics_contact.qp.coarse import CoarseSpace, GramInverse, SparseGramInverse, invert_square
from fenics_contact.qp.face import classify
from fenics_contact.qp.face_system import FaceSystem
from fenics_contact.qp.layout import ContactLayout


@pytest.fixture(params=["dense", "sparse"], autouse=True)
def kind(request, monkeypatch):
    """Run every test with the small matrices dense on every rank, and sparse on a few ranks."""
    if request.param == "sparse":
        monkeypatch.setattr(coarse_module, "DENSE_LIMIT", 0)
    return request.param


@pytest.fixture
def G():
    return np.random.default_rng(3).standard_normal((4, 15))


def coarse_space(G, e):
    return CoarseSpace(MPI.COMM_SELF, sp.csr_matrix(G), e)


def test_projector_is_orthogonal_and_annihilates_G(G):
    coarse = coarse_space(G, np.ones(4))
    P = np.column_stack([coarse.project(column) for column in np.eye(15)])
    np.testing.assert_allclose(P, P.T, atol=1e-14)
    np.testing.assert_allclose(P @ P, P, atol=1e-14)
    np.testing.assert_allclose(G @ P, 0.0, atol=1e-13)
    assert np.trace(P) == pytest.approx(11.0)


def test_particular_multiplier_is_the_shortest_in_equilibrium(G):
    e = np.array([1.0, -2.0, 0.5, 3.0])
    coarse = coarse_space(G, e)
    shortest = np.linalg.lstsq(G, e, rcond=None)[0]
    np.testing.assert_allclose(coarse.particular(), shortest, atol=1e-13)
    np.testing.assert_allclose(coarse.residual(coarse.particular()), 0.0, atol=1e-13)
    assert coarse.norm(e) == pytest.approx(np.linalg.norm(shortest))


def test_coefficients_fit_a_rigid_motion(G):
    alpha = np.array([0.1, 0.2, -0.3, 4.0])
    coarse = coarse_space(G, np.zeros(4))
    np.testing.assert_allclose(coarse.coefficients(coarse.transpose(alpha)), alpha, atol=1e-13)


def test_dependent_rows_are_found_and_projected_out(G):
    dependent = np.vstack([G, G[0] + G[1], np.zeros(15)])
    coarse = coarse_space(dependent, np.zeros(6))
    full = coarse_space(G, np.zeros(4))
    x = np.arange(15.0)
    assert coarse.gram.rank == 4
    np.testing.assert_allclose(coarse.project(x), full.project(x), atol=1e-12)
    gram = dependent @ dependent.T
    np.testing.assert_allclose(gram @ coarse.gram.null_space, 0.0, atol=1e-11)


def test_load_on_a_motion_without_rows_is_unresisted(G):
    rows = np.vstack([G, np.zeros(15)])
    assert np.abs(coarse_space(rows, np.array([1.0, 1, 1, 1, 0])).unresisted()).max() < 1e-12
    np.testing.assert_allclose(
        coarse_space(rows, np.array([1.0, 1, 1, 1, 7])).unresisted(), [0, 0, 0, 0, 7], atol=1e-12
    )


def test_units_of_rotations_do_not_change_the_rank(G):
    scaled = np.diag([1.0, 1e4, 1e-4, 1.0]) @ G
    assert coarse_space(scaled, np.zeros(4)).gram.rank == 4


def test_empty_coarse_space_does_nothing():
    coarse = coarse_space(np.zeros((0, 5)), np.zeros(0))
    x = np.arange(5.0)
    np.testing.assert_array_equal(coarse.project(x), x)
    np.testing.assert_array_equal(coarse.particular(), np.zeros(5))
    assert coarse.residual(x).shape == (0,)
    assert coarse.norm(np.zeros(0)) == 0.0


def test_restriction_to_a_face_keeps_only_its_columns(G):
    Z = sp.csr_matrix(np.eye(15)[:, [0, 3, 4, 8, 9, 14]])
    restricted = coarse_space(G, np.ones(4)).restricted(Z, 2 * np.ones(4))
    np.testing.assert_allclose(restricted.matrix.toarray(), G @ Z.toarray())
    np.testing.assert_allclose(restricted.matrix @ restricted.particular(), 2 * np.ones(4), atol=1e-12)


def test_wrong_load_length_is_refused(G):
    with pytest.raises(InvalidInputError, match=r"e must have 4 entries as G, got \(3,\)"):
        coarse_space(G, np.zeros(3))


def test_gram_inverse_of_several_columns(G):
    S = G @ G.T
    rhs = np.arange(8.0).reshape(4, 2)
    np.testing.assert_allclose(S @ GramInverse(S).solve(rhs), rhs, atol=1e-12)
    singular = np.pad(S, (0, 1))
    padded = np.vstack([rhs, np.zeros(2)])
    np.testing.assert_allclose(singular @ GramInverse(singular).solve(padded), padded, atol=1e-12)


def test_the_limit_decides_what_is_built(G, monkeypatch):
    for limit, expected in ((3, SparseGramInverse), (4, GramInverse)):
        monkeypatch.setattr(coarse_module, "DENSE_LIMIT", limit)
        assert type(coarse_space(G, np.ones(4)).gram) is expected


def test_more_null_vectors_than_the_first_block_are_all_found():
    G = np.random.default_rng(5).standard_normal((10, 60))
    dependent = np.vstack([G, G + 1.0 * G[::-1]])
    rank = np.linalg.matrix_rank(dependent)
    coarse = coarse_space(dependent, np.zeros(20))
    assert coarse.gram.rank == rank == 10
    x = np.random.default_rng(6).standard_normal(60)
    np.testing.assert_allclose(dependent @ coarse.project(x), 0.0, atol=1e-10)


def test_an_unsymmetric_matrix_is_inverted_and_a_singular_one_refused():
    matrix = np.random.default_rng(7).standard_normal((6, 6)) + 3 * np.eye(6)
    right = np.arange(6.0)
    inverse = invert_square(MPI.COMM_SELF, sp.csr_matrix(matrix), np.full(6, 0.5))
    assert inverse is not None
    np.testing.assert_allclose(inverse.solve(right), np.linalg.solve(matrix, right), rtol=1e-11)
    matrix[5] = matrix[0] + 2 * matrix[1]
    assert invert_square(MPI.COMM_SELF, sp.csr_matrix(matrix), np.full(6, 0.5)) is None


@pytest.mark.parametrize("seed", range(5))
def test_rounding_of_bodies_that_move_far_moves_no_others(seed):
    """Bodies in a row with two motions each, and a motion that no row feels."""
    rng = np.random.default_rng(seed)
    n = 24
    steps = np.eye(n) - np.eye(n, k=-1)
    G = np.vstack([np.kron(steps, rng.standard_normal((2, 6))), np.zeros((1, 6 * n))])
    coarse = coarse_space(G, np.zeros(2 * n + 1))
    none = np.zeros((0, 2), dtype=np.int64)
    layout = ContactLayout(6 * n, none[:, 0], none, none[:, 0])
    face = classify(layout, np.zeros(0), np.zeros(6 * n), np.zeros(6 * n), np.zeros(6 * n))
    alpha = np.concatenate([rng.uniform(25.0, 50.0, n), np.zeros(n + 1)])
    found = FaceSystem(MPI.COMM_SELF, face, lambda x: x, coarse).motions(G.T @ alpha)
    np.testing.assert_allclose(found[:n], alpha[:n], rtol=1e-11)
    assert np.abs(found[n:-1]).max() < 1e-16


def test_motions_are_fitted_to_their_last_places() -> None:
    """In a long chain of pieces, each glued to the next, errors of the solution add up."""
    n = 400
    chain = sp.diags([np.ones(n), -np.ones(n - 1)], [0, 1], format="csr")
    coarse, alpha = CoarseSpace(MPI.COMM_SELF, chain, np.zeros(n)), np.sin(np.arange(n))
    x = coarse.transpose(alpha)
    np.testing.assert_allclose(coarse.transpose(coarse.fitted(x)), x, rtol=0.0, atol=2 * np.finfo(float).eps)
