"""Motions without energy that no kernel names: their pivots are rounding, of either sign."""

from __future__ import annotations

import numpy as np
import pytest
import scipy.sparse as sp
from scipy.linalg import lapack

from fenics_contact.errors import ConvergenceError, InvalidInputError
from fenics_contact.feti.condensation import regular_factor
from fenics_contact.feti.factor import Factor

SEEDS = range(20)


def semidefinite(seed: int, size: int = 40, nullity: int = 2) -> tuple[np.ndarray, np.ndarray]:
    """Return a matrix with entries of several sizes, Fortran order, and its null vectors."""
    random = np.random.default_rng(seed)
    vectors, _ = np.linalg.qr(random.standard_normal((size, size)))
    values = np.append(np.zeros(nullity), random.uniform(0.1, 10.0, size - nullity))
    return np.asfortranarray((vectors * values) @ vectors.T), vectors[:, :nullity]


def test_a_schur_complement_with_a_further_null_vector_is_refused_whatever_its_rounding() -> None:
    accepted = 0
    for seed in SEEDS:
        schur, null = semidefinite(seed)
        factor, modes, rho, _ = regular_factor(schur.copy(order="F"), null, 1.0)
        found, exact = np.tril(factor) @ np.tril(factor).T, schur + rho * modes @ modes.T
        np.testing.assert_allclose(found, exact, atol=1e-12)
        with pytest.raises(InvalidInputError, match=r"but loses it in row \d+: .*two layers"):
            regular_factor(schur.copy(order="F"), null[:, :1], 1.0)
        held = schur + schur.diagonal().max() * null[:, :1] @ null[:, :1].T
        accepted += lapack.dpotrf(held, lower=1)[1] == 0
    assert accepted > 0  # LAPACK sees no fault in some of them


@pytest.mark.parametrize("unit", [1e-9, 1.0, 1e9])
def test_a_schur_complement_that_bends_as_flat_cells_do_is_factored(unit: float) -> None:
    """Of aspect 1000: by 1e-12 softer than it stretches, as singular ones have pivots of 1e-12 and less."""
    for seed in SEEDS:
        random = np.random.default_rng(seed)
        vectors, _ = np.linalg.qr(random.standard_normal((40, 40)))
        values = np.append([0.0, *random.uniform(1e-13, 1e-12, 9)], random.uniform(0.1, 10.0, 30))
        schur = np.asfortranarray(unit * (vectors * values) @ vectors.T)
        factor, modes, rho, _ = regular_factor(schur.copy(order="F"), vectors[:, :1], unit)
        found = np.tril(factor) @ np.tril(factor).T
        np.testing.assert_allclose(found, schur + rho * modes @ modes.T, atol=1e-13 * unit)


def chain(seed: int, held: float, unit: float = 1.0, size: int = 60) -> sp.csr_matrix:
    """Return the stiffness of a net of springs, held at one point."""
    random = np.random.default_rng(seed)
    first, second = np.triu_indices(size, 1)
    near = second - first < 4
    first, second, stiff = first[near], second[near], random.uniform(0.1, 10.0, near.sum())
    rows = sp.csr_matrix(
        (
            np.tile([1.0, -1.0], len(first)),
            (np.repeat(np.arange(len(first)), 2), np.c_[first, second].ravel()),
        )
    )
    matrix = (rows.T @ sp.diags(stiff) @ rows).tolil()
    matrix[seed % size, seed % size] += held
    return unit * matrix.tocsr()


def test_a_factor_of_a_floating_stiffness_is_refused_whatever_its_rounding() -> None:
    refused = []
    for seed in SEEDS:
        with pytest.raises((InvalidInputError, ConvergenceError)) as error:
            Factor.of_stiffness(chain(seed, 0.0))
        refused.append(str(error.value))
    unseen = [text for text in refused if "a factored stiffness must resist every motion" in text]
    assert unseen  # the library sees no fault in some of them
    assert all("integration='stabilised', or take two layers" in text for text in unseen)


@pytest.mark.parametrize("unit", [1e-12, 1.0, 1e12])
@pytest.mark.parametrize("held", [1e-9, 1.0])
def test_a_stiffness_held_by_little_is_factored_in_any_unit(held: float, unit: float) -> None:
    matrix = chain(0, held, unit)
    factor = Factor.of_stiffness(matrix)
    factor.solve(matrix @ np.ones(factor.size), found := np.empty(factor.size))
    np.testing.assert_allclose(found, 1.0, rtol=1e-12 / held)
