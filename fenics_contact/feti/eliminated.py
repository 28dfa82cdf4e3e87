"""Motions eliminated from coarse matrices, by one rank or several: factors of A_ii, and of S + C of faces."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property
from typing import Any, ClassVar

import numpy as np
import scipy.sparse as sp

from fenics_contact._base.libraries import MPI, PETSc
from fenics_contact._base.sparse import SharedFactor
from fenics_contact.errors import ConvergenceError, together
from fenics_contact.feti.condensation import Condensation
from fenics_contact.feti.factor import Factor, require_factored
from fenics_contact.qp.coarse import (
    RANK_TOLERANCE,
    DenseSquareInverse,
    GramInverse,
    SparseGramInverse,
    factored_gram,
    factored_square,
    summed_if_small,
)
from fenics_contact.qp.reductions import Vector, global_sum


@dataclass(frozen=True, eq=False)
class Eliminated:
    """The motions i that no contact row resists: x_i = A_ii⁻¹ (b_i − A_ic x_c), all scaled.

    `comm`: ranks that hold the factors; `own`: this rank's motions among i; `coupling`: its rows of A_ic;
    `reduced`: its share of S.
    """

    comm: MPI.Comm
    factor: Any
    own: slice
    coupling: sp.csr_matrix
    reduced: Vector | sp.csr_matrix

    @classmethod
    def of(cls, comm: MPI.Comm, matrix: sp.csr_matrix, touched: np.ndarray) -> Eliminated | None:
        """Eliminate from A, scaled, shape (m, m); None where A_ii is singular."""
        inside, there = matrix[~touched], np.flatnonzero(touched)
        try:
            factor = Factor(inside[:, ~touched].tocsr())
        except ConvergenceError:  # not positive definite
            return None
        probes = np.random.default_rng(0).standard_normal((factor.size, 4))
        for _ in range(2):
            before = np.linalg.norm(probes, axis=0)
            probes = factor.solve_many(probes)
            if not np.linalg.norm(probes, axis=0).max() < before.max() / RANK_TOLERANCE:
                return None
        reduced = Condensation(matrix, there)(matrix) if len(there) else np.zeros((0, 0))
        reduced = np.tril(reduced) + np.tril(reduced, -1).T  # the other triangle is not formed
        return cls(comm, factor, slice(None), inside[:, touched].tocsr(), reduced)

    @cached_property
    def transposed(self) -> sp.csc_matrix:
        """A_ci, which shares the memory of A_ic, shape (n_c, n_i)."""
        return self.coupling.T

    def inner(self, right: Vector) -> Vector:
        """Return A_ii⁻¹ times a vector, shape (n_own,)."""
        self.factor.solve(right, solution := np.empty(len(right)))
        return solution

    def summed(self, share: Vector) -> Vector:
        """Return the sum over ranks."""
        return share

    def gathered(self, own: Vector) -> Vector:
        """Return a vector of all i on the first rank."""
        return own

    def gram(self, added: sp.csr_matrix) -> GramInverse | SparseGramInverse:
        """Return (S + C)⁻¹ for this rank's share of C."""
        return GramInverse(self.reduced + added.toarray())

    def square(self, added: sp.csr_matrix) -> DenseSquareInverse | SharedFactor:
        """Return the same where C is not symmetric."""
        matrix = self.reduced + added.toarray()
        return DenseSquareInverse(matrix, _scale(np.abs(matrix).max(axis=1, initial=0.0)))

    @property
    def flops(self) -> int:
        """Floating point operations of a solution, without those of its dense block."""
        return 8 * self.factor.entries + 4 * self.coupling.nnz


def _scale(rows: Vector) -> Vector:
    """Return factors for rows and columns from the largest entries of rows."""
    return np.asarray(1.0 / np.sqrt(np.where(rows > 0.0, rows, 1.0)))


@dataclass(frozen=True, eq=False)
class SharedEliminated(Eliminated):
    """The same by several ranks, of which each calls every method, and has rows of A and columns of S.

    `width`: columns of S that are solved for together.
    """

    factor: SharedCholesky
    width: ClassVar[int] = 64

    @classmethod
    def of(cls, comm: MPI.Comm, matrix: sp.csr_matrix, touched: np.ndarray) -> SharedEliminated | None:
        """Eliminate from the sum of A's shares. Collective."""
        inside = matrix[~touched]
        try:
            factor = SharedCholesky(comm, inside[:, ~touched].tocsr())
        except ConvergenceError:
            return None
        if not factor.condition > RANK_TOLERANCE:
            return None
        coupling = factor.own_rows(inside[:, touched])
        reduced = matrix[touched][:, touched] - cls._bent(factor, coupling)
        return cls(comm, factor, factor.own, coupling, reduced.tocsr())

    @classmethod
    def _bent(cls, factor: SharedCholesky, coupling: sp.csr_matrix) -> sp.csc_matrix:
        """Return A_ci A_ii⁻¹ A_ic, of which this rank has every so many columns. Collective."""
        comm, mine, size = factor.comm, coupling.tocsc(), coupling.shape[1]
        columns = [sp.csc_matrix((size, 0))]
        for number, start in enumerate(range(0, size, cls.width)):
            some, holder = mine[:, start : start + cls.width], number % comm.size
            part = np.ascontiguousarray(mine.T @ factor.solve_many(some.toarray()))
            comm.Reduce(part, total := np.zeros_like(part), root=holder)
            columns.append(sp.csc_matrix(total))  # zero on other ranks
        return sp.hstack(columns, format="csc")

    def inner(self, right: Vector) -> Vector:
        """Return this rank's part of A_ii⁻¹ times a vector. Collective."""
        return self.factor.solve_own(right)

    def summed(self, share: Vector) -> Vector:
        """Return the sum over ranks. Collective."""
        return global_sum(self.comm, share)

    def gathered(self, own: Vector) -> Vector:
        """Return a vector of all i on the first rank. Collective."""
        return self.factor.gathered(own)

    def gram(self, added: sp.csr_matrix) -> GramInverse | SparseGramInverse:
        """Return (S + C)⁻¹. Collective."""
        return factored_gram(self.comm, summed_if_small(self.comm, self.reduced + added), SharedDense)

    def square(self, added: sp.csr_matrix) -> DenseSquareInverse | SharedFactor:
        """Return the same where C is not symmetric. Collective."""
        share = self.reduced + added
        rows = global_sum(self.comm, abs(share).max(axis=1).toarray().ravel())
        return factored_square(self.comm, summed_if_small(self.comm, share), _scale(rows), SharedDense)


class SharedCholesky(SharedFactor):
    """Cholesky factor of a positive definite Σ A_rank by MUMPS on all ranks of a communicator."""

    kind = "cholesky"

    def __init__(self, comm: MPI.Comm, share: sp.csr_matrix) -> None:
        """Sum the shares, of order one, and factor. Collective.

        Raises:
            ConvergenceError: On all ranks, where the sum is not positive definite.
        """
        super().__init__(comm, share, np.ones(share.shape[0]), holders=comm.size)
        self.comm = comm
        with together(comm):
            require_factored(self._ksp.getPC().getFactorMatrix())

    def _given(self, matrix: PETSc.Mat) -> PETSc.Mat:
        matrix.setOption(PETSc.Mat.Option.SPD, True)
        matrix.setOption(PETSc.Mat.Option.SYMMETRIC, True)
        return matrix

    def solve_many(self, right: Vector) -> Vector:
        """Return this rank's rows of A⁻¹ times an array of which it has its rows, (n_own, k). Collective."""
        shape = ((len(right), self.size), (None, right.shape[1]))
        given = PETSc.Mat().createDense(shape, array=np.asfortranarray(right), comm=self.comm)
        solutions = PETSc.Mat().createDense(shape, comm=self.comm)
        solutions.setUp()
        self._ksp.getPC().getFactorMatrix().matSolve(given, solutions)
        solution = np.array(solutions.getDenseArray())
        given.destroy()
        solutions.destroy()
        return solution


class SharedDense(SharedFactor):
    """LU factors of a full Σ A_rank by ScaLAPACK on all ranks of a communicator."""

    package = "scalapack"

    def __init__(self, comm: MPI.Comm, share: sp.csr_matrix, scale: Vector) -> None:
        """Sum the shares and factor. Collective."""
        super().__init__(comm, share, scale, holders=comm.size)

    def _given(self, matrix: PETSc.Mat) -> PETSc.Mat:
        return super()._given(matrix).convert("scalapack")

    def _entries_of(self, factor: PETSc.Mat) -> int:
        return self.size**2 // self.holders
