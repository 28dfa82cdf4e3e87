"""Schur complements of subdomains, however few of their dofs lie inside."""

from __future__ import annotations

import numpy as np
import pytest
import scipy.sparse as sp

from fenics_contact.feti.inverse import Condensation


@pytest.mark.parametrize("inside", [1, 2, 5, 30])
def test_a_condensation_is_the_schur_complement_however_few_dofs_lie_inside(inside: int) -> None:
    random = np.random.default_rng(inside)
    size = 24 + inside // 2
    root = random.standard_normal((size, size))
    matrix = root @ root.T + np.eye(size)
    interface = np.sort(random.choice(size, size - min(inside, size - 1), replace=False))
    within = np.setdiff1d(np.arange(size), interface)
    given = sp.csr_matrix(matrix)
    condensation = Condensation(given, interface)
    reduced = np.linalg.solve(matrix[np.ix_(within, within)], matrix[np.ix_(within, interface)])
    expected = matrix[np.ix_(interface, interface)] - matrix[np.ix_(interface, within)] @ reduced
    # MUMPS fills one triangle, and may take too little memory for the integers of small matrices.
    for found in (condensation(given), condensation._by_factor(given)):
        small = 1e-12 * np.abs(expected).max()
        assert np.tril(found) == pytest.approx(np.tril(expected), rel=1e-10, abs=small)
