"""Factors of symmetric matrices that may be indefinite."""

from __future__ import annotations

import numpy as np
import scipy.sparse as sp

from fenics_contact._libraries import PETSc
from fenics_contact.errors import ConvergenceError
from fenics_contact.feti import Factor, petsc_call, require_factored, symmetric_matrix

#: Largest residual of a solution with factors that are used, relative to its right side.
WRONG = 1e-8
#: Further memory that MUMPS may take where its estimate was too small, in percent.
ROOM = (100, 400)


class RefillableFactor(Factor):
    """Cholesky factors that may take other matrices with the same pattern."""

    positive = True

    def __init__(self, matrix: sp.csr_matrix) -> None:
        """Factor ``matrix``, shape (n, n)."""
        self._pattern = matrix.indptr, matrix.indices
        super().__init__(matrix)

    def refill(self, matrix: sp.csr_matrix) -> bool:
        """Factor another matrix instead, without a new analysis; False where that cannot be done.

        For small matrices the analysis takes most of the time.
        """
        pattern = matrix.indptr, matrix.indices
        if not all(np.array_equal(mine, other) for mine, other in zip(self._pattern, pattern, strict=True)):
            return False
        given = symmetric_matrix(matrix, shared=True)
        given.setOption(PETSc.Mat.Option.SPD, self.positive)
        petsc_call("MatCholeskyFactorNumeric", self._factor.handle, given.handle, None)
        given.destroy()
        return self._complete()

    def _complete(self) -> bool:
        return True

    def fits(self, matrix: sp.csr_matrix) -> bool:
        """Return whether a solution satisfies its equations: without pivoting it may not."""
        right = np.random.default_rng(0).standard_normal(self.size)
        self.solve(right, solution := np.empty_like(right))
        return bool(np.linalg.norm(matrix @ solution - right) <= WRONG * np.linalg.norm(right))


class IndefiniteFactor(RefillableFactor):
    """LDLᵀ factors of a sparse symmetric matrix on one rank, by MUMPS, with the number of negative pivots."""

    positive = False
    #: Further memory of each analysis, in percent; MUMPS's own first.
    _memory: tuple[int | None, ...] = (None, *ROOM)

    @property
    def negative(self) -> int:
        """Number of negative eigenvalues."""
        return int(self._factor.getInertia()[0])

    def _set_up(self, pc: PETSc.PC, given: PETSc.Mat) -> None:
        given.setOption(PETSc.Mat.Option.SPD, False)
        for percent in self._memory:
            pc.setFactorSolverType("mumps")
            pc.setFactorSetUpSolverType()
            factor = pc.getFactorMatrix()
            # Without these MUMPS does not count the pivots of its last front, or PETSc does not ask for them.
            factor.setMumpsIcntl(13, 1)
            factor.setMumpsIcntl(24, 1)
            if percent is not None:
                factor.setMumpsIcntl(14, percent)
            pc.setUp()
            if factor.getMumpsInfog(1) not in (-8, -9):  # its words for too little memory
                break
            # PETSc takes no further matrix into factors that failed: they are analysed anew.
            pc.reset()
            pc.setOperators(given)
        require_factored(factor)

    def _complete(self) -> bool:
        return bool(self._factor.getMumpsInfog(1) >= 0)


def with_inertia(matrix: sp.csr_matrix, spent: RefillableFactor | None) -> IndefiniteFactor:
    """Return factors of a matrix that know its negative eigenvalues.

    Args:
        matrix: The matrix, shape (n, n).
        spent: Factors that nothing uses any more, to be refilled where they fit; None without any.
    """
    if isinstance(spent, IndefiniteFactor) and spent.refill(matrix):
        return spent
    return IndefiniteFactor(matrix)


def mostly_positive(matrix: sp.csr_matrix, spent: RefillableFactor | None) -> RefillableFactor:
    """Return factors of a matrix that is positive definite but for few exceptions; see `with_inertia`.

    Cholesky factors, which are much faster in small problems, unless their solutions are wrong.
    """
    try:
        if spent is None or isinstance(spent, IndefiniteFactor) or not spent.refill(matrix):
            spent = RefillableFactor(matrix)
    except (PETSc.Error, ConvergenceError):  # as later versions say that it is not positive definite
        return with_inertia(matrix, None)
    return spent if spent.fits(matrix) else with_inertia(matrix, None)
