"""Factors of symmetric matrices that may be indefinite."""

from __future__ import annotations

import numpy as np
import scipy.sparse as sp

from fenics_contact._libraries import PETSc
from fenics_contact.feti import Factor, petsc_call, symmetric_matrix


class IndefiniteFactor(Factor):
    """LDLᵀ factors of a sparse symmetric matrix on one rank, by MUMPS, with the number of negative pivots."""

    def __init__(self, matrix: sp.csr_matrix) -> None:
        """Factor ``matrix``, shape (n, n)."""
        self._pattern = matrix.indptr, matrix.indices
        super().__init__(matrix)

    @property
    def negative(self) -> int:
        """Number of negative eigenvalues."""
        return int(self._factor.getInertia()[0])

    def refill(self, matrix: sp.csr_matrix) -> bool:
        """Factor another matrix instead, without a new analysis; False where its pattern is another one.

        For small matrices the analysis takes most of the time.
        """
        pattern = matrix.indptr, matrix.indices
        if not all(np.array_equal(mine, other) for mine, other in zip(self._pattern, pattern, strict=True)):
            return False
        given = _symmetric(matrix)
        petsc_call("MatCholeskyFactorNumeric", self._factor.handle, given.handle, None)
        given.destroy()
        return True

    def _set_up(self, pc: PETSc.PC, given: PETSc.Mat) -> None:
        given.setOption(PETSc.Mat.Option.SPD, False)
        pc.setFactorSolverType("mumps")
        pc.setFactorSetUpSolverType()
        factor = pc.getFactorMatrix()
        # Without these MUMPS does not count the pivots of its last front, or PETSc does not ask for them.
        factor.setMumpsIcntl(13, 1)
        factor.setMumpsIcntl(24, 1)
        pc.setUp()


def factored(matrix: sp.csr_matrix, spent: IndefiniteFactor | None) -> IndefiniteFactor:
    """Return factors of a matrix, in place of others that nothing uses any more where they fit."""
    return spent if spent is not None and spent.refill(matrix) else IndefiniteFactor(matrix)


def _symmetric(matrix: sp.csr_matrix) -> PETSc.Mat:
    given = symmetric_matrix(matrix, shared=True)
    given.setOption(PETSc.Mat.Option.SPD, False)
    return given
