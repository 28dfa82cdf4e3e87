"""A sparse matrix factored on a few ranks and used by all."""

from __future__ import annotations

import numpy as np
import numpy.typing as npt
import scipy.sparse as sp

from fenics_contact._libraries import MPI, PETSc, check_not_forked, start
from fenics_contact.linalg.disposal import dispose_with

Vector = npt.NDArray[np.float64]

#: Number of rows per rank that takes part in the factorisation.
ROWS_PER_RANK = 20_000
#: Added to the diagonal of the scaled matrix, so that a singular one can be factored, too; one step of
#: refinement removes its effect from the solutions.
SHIFT = 1e-13

_subsets: dict[tuple[int, int], MPI.Comm] = {}


class SharedFactor:
    """LU factors of Σ A_rank by MUMPS on the first ranks of a communicator.

    Attributes:
        size: Number of rows.
        holders: Number of ranks that hold the factors.
    """

    def __init__(
        self, comm: MPI.Comm, share: sp.csr_matrix, scale: Vector, *, holders: int | None = None
    ) -> None:
        """Sum the shares and factor. Collective on ``comm``.

        Args:
            comm: Communicator of the ranks that use the factors.
            share: This rank's summand, shape (m, m).
            scale: Positive factors for rows and columns that bring the entries to order one, shape (m,),
                replicated.
            holders: Ranks that hold the factors; one for every `ROWS_PER_RANK` rows by default.
        """
        start(comm)
        self._comm, self.size, self._scale = comm, share.shape[0], scale
        wanted = -(-self.size // ROWS_PER_RANK) if holders is None else holders
        self.holders = max(1, min(comm.size, wanted))
        self._bounds = np.linspace(0, self.size, self.holders + 1).astype(np.int64)
        rows = self._own_rows(share)
        self._holds = comm.rank < self.holders
        self._subset = _first_ranks(comm, self.holders)
        if self._holds:
            self._factor(rows)

    def solve(self, right: Vector, *, refine: bool = True) -> Vector:
        """Return A⁻¹ times a replicated vector, shape (m,), replicated. Collective.

        Args:
            right: Right side, the same on every rank.
            refine: Correct for the shift.
        """
        check_not_forked()
        solution = np.empty(self.size)
        if self._holds:
            start, stop = self._bounds[self._comm.rank : self._comm.rank + 2]
            own = self._scale[start:stop]
            self._right.array_w[:] = own * right[start:stop]
            self._ksp.solve(self._right, self._left)
            if refine:
                self._matrix.mult(self._left, self._residual)
                self._residual.aypx(-1.0, self._right)
                self._ksp.solve(self._residual, self._correction)
                self._left.axpy(1.0, self._correction)
            local = own * self._left.array_r
            counts = np.diff(self._bounds)
            self._subset.Gatherv(local, (solution, counts, self._bounds[:-1], MPI.DOUBLE))
        if self._comm.size > 1:
            self._comm.Bcast(solution)
        return solution

    def _own_rows(self, share: sp.csr_matrix) -> sp.csr_matrix:
        """Return the scaled rows that this rank is to hold, summed over all ranks."""
        entries = share.tocoo()
        holder = np.searchsorted(self._bounds, entries.row, side="right") - 1
        order = np.argsort(holder, kind="stable")
        cuts = np.searchsorted(holder[order], np.arange(1, self._comm.size))
        values = entries.data * self._scale[entries.row] * self._scale[entries.col]
        columns = (entries.row, entries.col, values)
        outgoing = zip(*(np.split(column[order], cuts) for column in columns), strict=True)
        incoming = self._comm.alltoall(list(outgoing))
        row, column, value = (np.concatenate([part[i] for part in incoming]) for i in range(3))
        first = self._bounds[min(self._comm.rank, self.holders - 1)]
        height = self._bounds[self._comm.rank + 1] - first if self._comm.rank < self.holders else 0
        return sp.csr_matrix((value, (row - first, column)), shape=(height, self.size))

    def _factor(self, rows: sp.csr_matrix) -> None:
        start, height = self._bounds[self._comm.rank], rows.shape[0]
        # Every diagonal entry must exist for the shift, also zeros, which sums of sparse matrices drop.
        entries, own = rows.tocoo(), np.arange(height)
        value = np.concatenate([entries.data, np.zeros(height)])
        place = np.concatenate([entries.row, own]), np.concatenate([entries.col, start + own])
        rows = sp.csr_matrix((value, place), shape=rows.shape)
        csr = (rows.indptr.astype(PETSc.IntType), rows.indices.astype(PETSc.IntType), rows.data)
        shape = ((height, self.size), (height, self.size))
        self._matrix = PETSc.Mat().createAIJ(shape, csr=csr, comm=self._subset)
        shifted = self._matrix.copy()
        shifted.shift(SHIFT)
        self._ksp = PETSc.KSP().create(self._subset)
        self._ksp.setOperators(shifted)
        self._ksp.setType(PETSc.KSP.Type.PREONLY)
        pc = self._ksp.getPC()
        pc.setType(PETSc.PC.Type.LU)
        pc.setFactorSolverType("mumps")
        self._ksp.setUp()
        self._right, self._left = self._matrix.createVecs()
        self._residual, self._correction = self._matrix.createVecs()
        vectors = (self._right, self._left, self._residual, self._correction)
        dispose_with(self, pc, self._ksp, shifted, self._matrix, *vectors, comm=self._subset)


def _first_ranks(comm: MPI.Comm, count: int) -> MPI.Comm:
    """Return a communicator of the first ranks, made once for each communicator and count. Collective."""
    if count == 1:
        return MPI.COMM_SELF
    if count == comm.size:
        return comm
    key = (comm.py2f(), count)
    if key not in _subsets:
        _subsets[key] = comm.Split(0 if comm.rank < count else MPI.UNDEFINED)
    return _subsets[key]
