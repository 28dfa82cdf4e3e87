"""Factors of symmetric matrices that may be indefinite."""

from __future__ import annotations

from fenics_contact._libraries import PETSc
from fenics_contact.feti import Factor


class IndefiniteFactor(Factor):
    """LDLᵀ factors of a sparse symmetric matrix on one rank, by MUMPS, with the number of negative pivots.

    Attributes:
        negative: Number of negative eigenvalues.
    """

    negative: int

    def _set_up(self, pc: PETSc.PC, given: PETSc.Mat) -> None:
        given.setOption(PETSc.Mat.Option.SPD, False)
        pc.setFactorSolverType("mumps")
        pc.setFactorSetUpSolverType()
        factor = pc.getFactorMatrix()
        # Without these MUMPS does not count the pivots of its last front, or PETSc does not ask for them.
        factor.setMumpsIcntl(13, 1)
        factor.setMumpsIcntl(24, 1)
        pc.setUp()
        self.negative = int(factor.getInertia()[0])
