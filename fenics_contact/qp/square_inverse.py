"""Inverse of the unsymmetric matrix of a coarse space, dense while small, else sparse on a few ranks."""

from __future__ import annotations

from typing import Protocol

import numpy as np
import scipy.linalg
import scipy.sparse as sp
from scipy.linalg import lapack

from fenics_contact._libraries import MPI
from fenics_contact.linalg import SharedFactor
from fenics_contact.qp.coarse import summed_if_small
from fenics_contact.qp.reductions import Vector

#: Reciprocal condition number below which a matrix counts as singular.
RANK_TOLERANCE = 1e-10
#: Number of random vectors in the search for a null vector.
PROBES = 4


class SquareInverse(Protocol):
    """The inverse of a square matrix."""

    def solve(self, right_side: Vector) -> Vector:
        """Return the inverse times a replicated array of shape (m,). Collective."""


def invert_square(comm: MPI.Comm, share: sp.csr_matrix, scale: Vector) -> SquareInverse | None:
    """Factor the sum of the ranks' shares; None if it is singular. Collective.

    Args:
        comm: Communicator of the ranks.
        share: This rank's summand, shape (m, m).
        scale: Factors for rows and columns that bring the entries to order one, shape (m,), replicated.
    """
    matrix = summed_if_small(comm, share)
    if isinstance(matrix, np.ndarray):
        dense = DenseSquareInverse(matrix, scale)
        return dense if dense.condition > RANK_TOLERANCE else None
    factor = SharedFactor(comm, share, scale)
    return factor if _largest_growth(factor, scale) < 1.0 / RANK_TOLERANCE else None


class DenseSquareInverse:
    """LU factors of a small matrix, scaled.

    Attributes:
        condition: Reciprocal condition number; zero where the matrix is singular.
    """

    def __init__(self, matrix: Vector, scale: Vector) -> None:
        """Factor a replicated matrix, shape (m, m)."""
        self._scale, self.condition = scale, 1.0
        if len(matrix) == 0:
            return
        scaled = scale[:, None] * matrix * scale
        lu, pivots, failed = lapack.dgetrf(scaled)
        norm = np.abs(scaled).sum(axis=0).max()
        self.condition = 0.0 if failed or norm == 0.0 else float(lapack.dgecon(lu, norm)[0])
        self._factor = (lu, pivots)

    def solve(self, right_side: Vector) -> Vector:
        """Return the inverse times a replicated array of shape (m,)."""
        if right_side.size == 0:
            return right_side
        solved = scipy.linalg.lu_solve(self._factor, self._scale * right_side, check_finite=False)
        return np.asarray(self._scale * solved)


def _largest_growth(factor: SharedFactor, scale: Vector) -> float:
    """Return a lower estimate of the scaled inverse's norm by inverse iteration. Collective."""
    largest = 0.0
    for start in np.random.default_rng(0).standard_normal((PROBES, factor.size)):
        x = start / np.linalg.norm(start)
        for _ in range(2):
            x = factor.solve(x / scale, refine=False) / scale
            growth = float(np.linalg.norm(x))
            x /= growth
        largest = max(largest, growth)
    return largest
