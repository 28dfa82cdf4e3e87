"""Inverse of a small symmetric positive semidefinite matrix, by Cholesky where it can be trusted."""

from __future__ import annotations

import numpy as np
import scipy.linalg
from scipy.linalg import lapack

from fenics_contact.qp.reductions import Vector

RANK_TOLERANCE = 1e-12


class GramInverse:
    """Generalised inverse of S = G G^T that survives a rank deficiency.

    S is scaled to unit diagonal first, because its rows mix translations and rotations. A well conditioned
    S is factored by Cholesky; otherwise its eigenvectors say which combinations of rows carry nothing and
    the inverse acts on the others. For any generalised inverse G^T S^- G is the same projector.

    Attributes:
        rank: Number of independent rows.
        null_space: Columns z with S z = 0, shape (m, m - rank): motions that no multiplier resists.
    """

    def __init__(self, matrix: Vector) -> None:
        """Factor ``matrix`` of shape (m, m); only its values on this rank are used, no communication."""
        diagonal = np.diagonal(matrix)
        floor = RANK_TOLERANCE**2 * max(diagonal.max(initial=0.0), np.finfo(float).tiny)
        self._scale = 1.0 / np.sqrt(np.where(diagonal > floor, diagonal, 1.0))
        scaled = self._scale[:, None] * matrix * self._scale
        self.rank = len(matrix)
        self.null_space = np.zeros((len(matrix), 0))
        self._cholesky = _trusted_cholesky(scaled)
        if self._cholesky is None:
            values, vectors = scipy.linalg.eigh(scaled)
            keep = values > RANK_TOLERANCE * values.max(initial=0.0)
            self.rank = int(keep.sum())
            self.null_space = self._scale[:, None] * vectors[:, ~keep]
            self._root = vectors[:, keep] / np.sqrt(values[keep])

    def solve(self, right_side: Vector) -> Vector:
        """Apply the generalised inverse to an array of shape (m,) or (m, k)."""
        if right_side.size == 0:
            return np.zeros_like(right_side)
        scale = self._scale if right_side.ndim == 1 else self._scale[:, None]
        if self._cholesky is None:
            return scale * (self._root @ (self._root.T @ (scale * right_side)))
        return scale * scipy.linalg.cho_solve((self._cholesky, True), scale * right_side, check_finite=False)


def _trusted_cholesky(matrix: Vector) -> Vector | None:
    """Return the lower Cholesky factor, or None if the matrix is singular or close to it."""
    if len(matrix) == 0:
        return np.zeros((0, 0))
    factor, info = lapack.dpotrf(matrix, lower=1)
    if info != 0:
        return None
    reciprocal_condition, _ = lapack.dpocon(factor, np.abs(matrix).sum(axis=0).max(), uplo="L")
    return factor if reciprocal_condition > RANK_TOLERANCE else None
