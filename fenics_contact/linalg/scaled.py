"""Sparse matrices whose rows or columns are multiplied by numbers, without the cost of a product."""

from __future__ import annotations

import numpy as np
import scipy.sparse as sp


def scaled_rows(matrix: sp.csr_matrix, factors: np.ndarray) -> sp.csr_matrix:
    """Return diag(factors) @ matrix, which stores no zeros; factors have shape (n_rows,)."""
    return _with_values(matrix, matrix.data * np.repeat(factors, np.diff(matrix.indptr)))


def scaled_columns(matrix: sp.csr_matrix, factors: np.ndarray) -> sp.csr_matrix:
    """Return matrix @ diag(factors), which stores no zeros; factors have shape (n_columns,)."""
    return _with_values(matrix, matrix.data * factors[matrix.indices])


def _with_values(matrix: sp.csr_matrix, values: np.ndarray) -> sp.csr_matrix:
    if np.count_nonzero(values) == len(values):
        return sp.csr_matrix((values, matrix.indices, matrix.indptr), shape=matrix.shape)
    # Zeros are taken out in place: the pattern must not be that of the given matrix.
    result = sp.csr_matrix((values, matrix.indices, matrix.indptr), shape=matrix.shape, copy=True)
    result.eliminate_zeros()
    return result
