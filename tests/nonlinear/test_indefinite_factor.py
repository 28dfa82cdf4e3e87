"""Factors of tangents: they take over analyses, and find out where a matrix is not positive definite."""

import numpy as np
import pytest
import scipy.sparse as sp

from fenics_contact._large_deformations.tangent import (
    IndefiniteFactor,
    RefillableFactor,
    _softest,
    mostly_positive,
    with_inertia,
)
from fenics_contact.errors import ConvergenceError


def stiffness(shift: float) -> sp.csr_matrix:
    """Return the Laplacian of a square of 20 by 20 points less a shift; its least eigenvalue is 0.0447."""
    line = sp.diags([-np.ones(19), np.full(20, 2.0), -np.ones(19)], [-1, 0, 1])
    whole = sp.kron(line, sp.identity(20)) + sp.kron(sp.identity(20), line)
    return (whole - shift * sp.identity(400)).tocsr()


@pytest.mark.parametrize("factored", [with_inertia, mostly_positive])
@pytest.mark.parametrize("shift", [0.0, 0.03, 1.0])
def test_spent_factors_solve_with_another_matrix(factored, shift):
    spent = factored(stiffness(0.01), None)
    matrix, right = stiffness(shift), np.linspace(1.0, 2.0, 400)
    factor = factored(matrix, spent)
    factor.solve(right, solution := np.empty(400))
    assert np.abs(solution).max() > 0.1
    np.testing.assert_allclose(matrix @ solution, right, rtol=1e-9)


def test_refilled_factors_count_negative_eigenvalues_anew():
    spent = with_inertia(stiffness(0.0), None)
    assert spent.negative == 0
    factor = with_inertia(matrix := stiffness(1.0), spent)
    assert factor is spent
    assert factor.negative == np.count_nonzero(np.linalg.eigvalsh(matrix.toarray()) < 0.0) > 0


def test_factors_of_another_pattern_are_not_refilled():
    spent = with_inertia(stiffness(0.0), None)
    matrix = sp.identity(400, format="csr") * 2.0
    factor = with_inertia(matrix, spent)
    assert factor is not spent
    factor.solve(np.ones(400), solution := np.empty(400))
    np.testing.assert_allclose(solution, 0.5)


def test_cholesky_factors_that_do_not_fit_are_replaced(monkeypatch):
    monkeypatch.setattr(RefillableFactor, "accuracy", 0.0)
    assert isinstance(mostly_positive(stiffness(0.0), None), IndefiniteFactor)


def test_a_matrix_that_is_not_positive_definite_is_told_by_an_error_alone(capfd):
    line = sp.diags([-np.ones(11), np.full(12, 2.0), -np.ones(11)], [-1, 0, 1])
    one = sp.identity(12)
    orders = ((line, one, one), (one, line, one), (one, one, line))
    whole = sum(sp.kron(sp.kron(a, b), c) for a, b, c in orders)
    matrix = (whole - 0.5 * sp.identity(12**3)).tocsr()
    assert isinstance(mostly_positive(matrix, None), IndefiniteFactor)
    with pytest.raises(ConvergenceError, match=r"must have factors, but .* not positive definite"):
        RefillableFactor(matrix)
    assert capfd.readouterr() == ("", "")


def test_factors_for_which_mumps_takes_too_little_memory_are_made_with_more(monkeypatch):
    line = sp.diags([-np.ones(29), np.full(30, 2.0), -np.ones(29)], [-1, 0, 1])
    one = sp.identity(30)
    orders = ((line, one, one), (one, line, one), (one, one, line))
    matrix = sum(sp.kron(sp.kron(a, b), c) for a, b, c in orders).tocsr() - sp.identity(30**3, format="csr")
    monkeypatch.setattr(IndefiniteFactor, "_memory", (-90,))
    with pytest.raises(ConvergenceError, match=r"MUMPS ends with INFOG\(1\) = -9"):
        with_inertia(matrix, None)
    monkeypatch.setattr(IndefiniteFactor, "_memory", (-90, 100))
    factor, right = with_inertia(matrix, None), np.linspace(1.0, 2.0, 30**3)
    factor.solve(right, solution := np.empty(30**3))
    np.testing.assert_allclose(matrix @ solution, right, rtol=1e-9)
    assert factor.negative > 10


def test_factors_that_mumps_cannot_complete_are_refused():
    matrix = stiffness(0.0)
    matrix.data[:] = np.nan
    with pytest.raises(ConvergenceError, match=r"must have factors, but MUMPS ends with INFOG\(1\) = -"):
        with_inertia(matrix, None)


def test_negative_motions_are_found_next_to_zero_and_far_below_it():
    """The inverse has the latter amid a cluster: some cells have lost their strength, a body buckles."""
    values = np.concatenate([[-1e9, -3e8, -2e7, -0.02, -0.01], np.geomspace(0.05, 1e7, 395)])
    mixing = np.linalg.qr(np.random.default_rng(1).standard_normal((20, 20)))[0]
    turned = sp.kron(sp.identity(20), mixing).tocsr()[:, np.random.default_rng(2).permutation(400)]
    matrix = (turned @ sp.diags(values) @ turned.T).tocsr()
    factor = with_inertia(matrix, None)
    assert factor.negative == 5
    probes = np.random.default_rng(0).standard_normal((400, 4))
    found, vectors = _softest(matrix, factor, probes, 2)
    negative = vectors[:, found < 0.0]
    assert negative.shape[1] == 5
    held = matrix + 2e9 * negative @ negative.T
    assert np.linalg.eigvalsh(held).min() > 0.0
