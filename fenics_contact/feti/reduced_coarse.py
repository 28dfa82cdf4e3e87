"""Coarse matrices of faces, reduced once to the rigid motions on which contact acts."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from functools import cached_property
from typing import TypeVar

import numpy as np
import scipy.sparse as sp

from fenics_contact._base.libraries import MPI
from fenics_contact._base.sparse import sent
from fenics_contact.errors import ConvergenceError, together
from fenics_contact.feti.condensation import Condensation
from fenics_contact.feti.factor import Factor
from fenics_contact.qp.coarse import RANK_TOLERANCE, DenseSquareInverse, GramInverse
from fenics_contact.qp.reductions import Vector, global_sum

Block = TypeVar("Block", GramInverse, DenseSquareInverse)


@dataclass(frozen=True, eq=False)
class Elimination:
    """Eliminates the motions that no contact row resists from the coarse matrices of faces.

    With the columns of equality rows, which every face has, first, G Z = [G_E, G_C Z_C] and

        G Z Zᵀ Gᵀ = A + C,   A = G_E G_Eᵀ,   C = (G_C Z_C) (G_C Z_C)ᵀ.

    C is zero but for the motions c of the subdomains with contact rows. A is factored on the others, i, once,
    and each face factors S + C alone, S = A_cc − A_ci A_ii⁻¹ A_ic: dense, but small. A_ii is regular unless
    some motion is resisted by no row at all. `equality`: the equality rows among this rank's multipliers;
    `largest`: it pays if c is no larger than this times m^(2/3), nor than m/2, of m motions in all: S then
    has no more numbers than half the sparse factors of one face; `most`: motions beyond which the coarse
    matrices are distributed over ranks instead.
    """

    equality: np.ndarray
    largest: float = 4.0
    most: int = 250_000

    def __call__(self, comm: MPI.Comm, columns: sp.csr_matrix) -> ReducedGrams | None:
        """Return the reduced matrices; None where they do not pay, or A_ii is singular. Collective."""
        contact = np.ones(columns.shape[1], dtype=bool)
        contact[self.equality] = False
        touched = global_sum(comm, np.diff(columns[:, contact].indptr)) > 0.0
        if not self.pays(len(touched), np.count_nonzero(touched)):
            return None
        return ReducedGrams.build(comm, columns, self.equality, touched)

    def pays(self, motions: int, touched: int) -> bool:
        """Return whether it pays to eliminate from m motions all but c."""
        return motions <= self.most and touched <= min(self.largest * motions ** (2 / 3), 0.5 * motions)


@dataclass(frozen=True, eq=False)
class ReducedGrams:
    """Inverses of A + C for faces, see `Elimination`; the factors are on the first rank.

    `touched`: marks of the motions c, replicated.
    """

    comm: MPI.Comm
    scale: Vector
    touched: np.ndarray
    eliminated: Eliminated | None

    @classmethod
    def build(
        cls, comm: MPI.Comm, columns: sp.csr_matrix, equality: np.ndarray, touched: np.ndarray
    ) -> ReducedGrams | None:
        """Factor A_ii and form S; None where A_ii is singular. Collective."""
        diagonal = global_sum(comm, np.asarray(columns.power(2).sum(axis=1)).ravel())
        scale = 1.0 / np.sqrt(np.maximum(diagonal, np.finfo(float).tiny))
        glued = columns[:, equality]
        matrix = _on_first(comm, (glued @ glued.T).tocsr(), scale)
        with together(comm):
            eliminated = None if matrix is None else Eliminated.of(matrix, touched)
        regular = comm.bcast(eliminated is not None)
        return cls(comm, scale, touched, eliminated) if regular else None

    def inverse(self, contact: sp.csr_matrix) -> ReducedInverse:
        """Return (A + C)⁻¹. Collective."""
        return self._inverse((contact @ contact.T).tocsr(), GramInverse)

    def square(
        self, moving: sp.csr_matrix, tested: sp.csr_matrix, singular: float = 1e-10
    ) -> ReducedInverse | None:
        """Return (A + G_u G_sᵀ)⁻¹, None if its reciprocal condition is below ``singular``. Collective."""
        inverse = self._inverse((moving @ tested.T).tocsr(), _square)
        return inverse if inverse.condition > singular else None

    def _inverse(self, share: sp.csr_matrix, invert: Callable[[Vector], Block]) -> ReducedInverse:
        """Return the inverse of A + Σ shares, shape (m, m) each. Collective."""
        there = np.flatnonzero(self.touched)
        added = _on_first(self.comm, share[there][:, there].tocsr(), self.scale[there])
        block = None
        with together(self.comm):
            if self.eliminated is not None and added is not None:
                block = invert(self.eliminated.reduced + added.toarray())
        return ReducedInverse(self, block)


def _square(matrix: Vector) -> DenseSquareInverse:
    rows = np.abs(matrix).max(axis=1, initial=0.0)
    return DenseSquareInverse(matrix, 1.0 / np.sqrt(np.where(rows > 0.0, rows, 1.0)))


@dataclass(frozen=True, eq=False)
class Eliminated:
    """The motions i that no contact row resists: x_i = A_ii⁻¹ (b_i − A_ic x_c), all scaled."""

    factor: Factor
    coupling: sp.csr_matrix
    reduced: Vector

    @classmethod
    def of(cls, matrix: sp.csr_matrix, touched: np.ndarray) -> Eliminated | None:
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
        return cls(factor, inside[:, touched].tocsr(), reduced)

    @cached_property
    def transposed(self) -> sp.csc_matrix:
        """A_ci, which shares the memory of A_ic, shape (n_c, n_i)."""
        return self.coupling.T

    def inner(self, right: Vector) -> Vector:
        """Return A_ii⁻¹ times a vector, shape (n_i,)."""
        self.factor.solve(right, solution := np.empty(len(right)))
        return solution

    @property
    def flops(self) -> int:
        """Floating point operations of a solution, without those of its dense block."""
        return 8 * self.factor.entries + 4 * self.coupling.nnz


class ReducedInverse:
    """(A + C)⁻¹ by block elimination; generalised where the face does not resist all motions.

    `null_space`: columns z with (A + C) z = 0, replicated; `condition`: reciprocal condition of S + C where
    it is unsymmetric.
    """

    def __init__(self, grams: ReducedGrams, block: GramInverse | DenseSquareInverse | None) -> None:
        """Take the inverse of S + C; None on all ranks but the first. Collective."""
        self._grams, self._block = grams, block
        null, condition = np.zeros((len(grams.scale), 0)), 1.0
        if isinstance(block, GramInverse):
            null = self._null_space(block.null_space)
        elif block is not None:
            condition = block.condition
        self.null_space, self.condition = grams.comm.bcast((null, condition))
        self.rank = len(grams.scale) - self.null_space.shape[1]

    @property
    def flops(self) -> int:
        """Floating point operations of one solution on this rank."""
        if self._block is None or self._grams.eliminated is None:
            return 0
        return self._grams.eliminated.flops + self._block.flops

    def solve(self, right_side: Vector) -> Vector:
        """Return the inverse times a replicated array of shape (m,). Collective."""
        solution, grams = np.empty(len(right_side)), self._grams
        if self._block is not None and grams.eliminated is not None:
            solution[:] = self._solved(grams.eliminated, self._block, right_side)
        if grams.comm.size > 1:
            grams.comm.Bcast(solution)
        return solution

    def _solved(
        self, inside: Eliminated, block: GramInverse | DenseSquareInverse, right_side: Vector
    ) -> Vector:
        scale, touched = self._grams.scale, self._grams.touched
        right = scale * right_side
        solution, bent = np.empty(len(right)), inside.inner(right[~touched])
        solution[touched] = block.solve(right[touched] - inside.transposed @ bent)
        solution[~touched] = bent - inside.inner(inside.coupling @ solution[touched])
        return scale * solution

    def _null_space(self, of_block: Vector) -> Vector:
        """Return the null vectors of A + C from those of S + C."""
        inside, touched = self._grams.eliminated, self._grams.touched
        null = np.empty((len(touched), of_block.shape[1]))
        if inside is not None and null.size:
            null[touched] = of_block
            null[~touched] = -inside.factor.solve_many(inside.coupling @ of_block)
        return self._grams.scale[:, None] * null


def _on_first(comm: MPI.Comm, share: sp.csr_matrix, scale: Vector) -> sp.csr_matrix | None:
    """Return the sum of shares of a matrix, scaled, on the first rank, None on others. Collective."""
    entries = share.tocoo()
    values = entries.data * scale[entries.row] * scale[entries.col]
    first = np.zeros(len(values), dtype=np.int64)
    row, column, value = sent(comm, first, entries.row, entries.col, values)
    return sp.csr_matrix((value, (row, column)), shape=share.shape) if comm.rank == 0 else None
