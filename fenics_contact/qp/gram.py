"""Generalised inverses of symmetric positive semidefinite matrices, dense or sparse."""

from __future__ import annotations

import numpy as np
import scipy.linalg
import scipy.sparse as sp
from scipy.linalg import lapack

from fenics_contact._libraries import MPI
from fenics_contact.linalg import SharedFactor
from fenics_contact.qp.reductions import Vector, global_sum

RANK_TOLERANCE = 1e-12


class GramInverse:
    """Generalised inverse of S = G G^T, which may be rank deficient.

    S is scaled to unit diagonal first, because its rows mix translations and rotations. A well conditioned
    S is factored by Cholesky; otherwise its eigenvectors separate the null space, and the inverse acts on the
    complement. For any generalised inverse G^T S^- G is the same projector.

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


#: Vectors in the first search for null vectors: a floating body has six.
FIRST_BLOCK = 8


class SparseGramInverse:
    """Generalised inverse of S = Σ S_rank, which may be rank deficient; see `GramInverse`.

    Null vectors are computed by inverse iteration with a few vectors, which converges at once for a matrix
    that is singular to rounding.

    Attributes:
        rank: Number of independent rows.
        null_space: Columns z with S z = 0, shape (m, m - rank): motions that no multiplier resists.
    """

    def __init__(self, comm: MPI.Comm, share: sp.csr_matrix) -> None:
        """Factor the sum of the ranks' shares, each of shape (m, m). Collective on ``comm``."""
        diagonal = global_sum(comm, share.diagonal())
        floor = RANK_TOLERANCE**2 * max(diagonal.max(initial=0.0), np.finfo(float).tiny)
        scale = 1.0 / np.sqrt(np.where(diagonal > floor, diagonal, 1.0))
        self._factor = SharedFactor(comm, share, scale)
        self._scale = scale
        self._null = self._null_vectors()
        self.rank = len(diagonal) - self._null.shape[1]
        self.null_space = scale[:, None] * self._null

    def solve(self, right_side: Vector) -> Vector:
        """Apply the generalised inverse to a replicated array of shape (m,). Collective."""
        if self._null.shape[1] == 0:
            return self._factor.solve(right_side)
        scaled = self._scale * right_side
        scaled = scaled - self._null @ (self._null.T @ scaled)
        solved = self._factor.solve(scaled / self._scale) / self._scale
        return self._scale * (solved - self._null @ (self._null.T @ solved))

    def _null_vectors(self) -> Vector:
        """Return orthonormal null vectors of the scaled matrix. Collective."""
        m = len(self._scale)
        count = min(FIRST_BLOCK, m)
        while True:
            start = np.random.default_rng(0).standard_normal((m, count))
            basis, _ = np.linalg.qr(self._invert_scaled(start))
            inverse = basis.T @ self._invert_scaled(basis)
            largest, turn = np.linalg.eigh(0.5 * (inverse + inverse.T))
            null = largest > 1.0 / RANK_TOLERANCE
            if not null.all() or count == m:
                return np.asarray(basis @ turn[:, null])
            count = min(2 * count, m)

    def _invert_scaled(self, columns: Vector) -> Vector:
        solved = [self._factor.solve(column / self._scale, refine=False) for column in columns.T]
        return np.column_stack(solved) / self._scale[:, None]
