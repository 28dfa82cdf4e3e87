"""Coarse matrices of faces, reduced once to the rigid motions on which contact acts."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from typing import ClassVar, TypeAlias

import numpy as np
import scipy.sparse as sp

from fenics_contact._base.libraries import MPI
from fenics_contact._base.sparse import ROWS_PER_RANK, SharedFactor, sent, spread
from fenics_contact.errors import together
from fenics_contact.errors.ranks import LONGEST_WAIT
from fenics_contact.feti.eliminated import Eliminated, SharedEliminated
from fenics_contact.qp.coarse import DenseSquareInverse, GramInverse, SparseGramInverse
from fenics_contact.qp.reductions import Vector, global_sum

#: Inverses of S + C.
Block: TypeAlias = GramInverse | SparseGramInverse | DenseSquareInverse | SharedFactor


@dataclass(frozen=True, eq=False)
class Elimination:
    """Eliminates the motions that no contact row resists from the coarse matrices of faces.

    With the columns of equality rows, which every face has, first, G Z = [G_E, G_C Z_C] and

        G Z Zᵀ Gᵀ = A + C,   A = G_E G_Eᵀ,   C = (G_C Z_C) (G_C Z_C)ᵀ.

    C is zero but for the motions c of the subdomains with contact rows. A is factored on the others, i, once,
    and each face factors S + C alone, S = A_cc − A_ci A_ii⁻¹ A_ic: dense, but small. A_ii is regular unless
    some motion is resisted by no row at all. `equality`: the equality rows among this rank's multipliers;
    `largest`: it pays if c is no larger than this times m^(2/3), nor than m/2, of m motions in all: S then
    has no more numbers than half the sparse factors of one face.
    """

    equality: np.ndarray
    largest: float = 4.0

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
        return touched <= min(self.largest * motions ** (2 / 3), 0.5 * motions)


@dataclass(frozen=True, eq=False)
class ReducedGrams:
    """Inverses of A + C for faces, see `Elimination`.

    `touched`: marks of the motions c, replicated; `ranks`: those that hold the factors, the first included;
    `eliminated`: their part of these. By fewer than `fewest` ranks factors are made no faster than by one.
    """

    comm: MPI.Comm
    scale: Vector
    touched: np.ndarray
    ranks: np.ndarray
    eliminated: Eliminated | None
    fewest: ClassVar[int] = 6
    rows_per_rank: ClassVar[int] = ROWS_PER_RANK

    @classmethod
    def holders(cls, ranks: int, motions: int) -> int:
        """Return how many ranks of a number of them hold the factors."""
        several = min(ranks, -(-motions // cls.rows_per_rank))
        return several if several >= cls.fewest else 1

    @classmethod
    def build(
        cls, comm: MPI.Comm, columns: sp.csr_matrix, equality: np.ndarray, touched: np.ndarray
    ) -> ReducedGrams | None:
        """Factor A_ii and form S; None where A_ii is singular. Collective."""
        diagonal = global_sum(comm, np.asarray(columns.power(2).sum(axis=1)).ravel())
        scale = 1.0 / np.sqrt(np.maximum(diagonal, np.finfo(float).tiny))
        glued = columns[:, equality]
        ranks, holders = spread(comm, cls.holders(comm.size, len(touched)))
        matrix = _dealt(comm, (glued @ glued.T).tocsr(), scale, ranks)
        kind = Eliminated if len(ranks) == 1 else SharedEliminated
        with together(comm, wait=LONGEST_WAIT):
            eliminated = None if matrix is None else kind.of(holders, matrix, touched)
        regular = comm.bcast(eliminated is not None)
        return cls(comm, scale, touched, ranks, eliminated) if regular else None

    def inverse(self, contact: sp.csr_matrix) -> ReducedInverse:
        """Return (A + C)⁻¹. Collective."""
        return self._inverse((contact @ contact.T).tocsr(), lambda inside, added: inside.gram(added))

    def square(
        self, moving: sp.csr_matrix, tested: sp.csr_matrix, singular: float = 1e-10
    ) -> ReducedInverse | None:
        """Return (A + G_u G_sᵀ)⁻¹, None if its reciprocal condition is below ``singular``. Collective."""
        inverse = self._inverse((moving @ tested.T).tocsr(), lambda inside, added: inside.square(added))
        return inverse if inverse.condition > singular else None

    def _inverse(
        self, share: sp.csr_matrix, invert: Callable[[Eliminated, sp.csr_matrix], Block]
    ) -> ReducedInverse:
        """Return the inverse of A + Σ shares, shape (m, m) each. Collective."""
        there = np.flatnonzero(self.touched)
        added = _dealt(self.comm, share[there][:, there].tocsr(), self.scale[there], self.ranks)
        block = None
        with together(self.comm, wait=LONGEST_WAIT):
            if self.eliminated is not None and added is not None:
                block = invert(self.eliminated, added)
        return ReducedInverse(self, block)


class ReducedInverse:
    """(A + C)⁻¹ by block elimination; generalised where the face does not resist all motions.

    `null_space`: columns z with (A + C) z = 0, replicated; `condition`: reciprocal condition of S + C where
    it is unsymmetric.
    """

    def __init__(self, grams: ReducedGrams, block: Block | None) -> None:
        """Take the inverse of S + C; None on ranks that hold no factors. Collective."""
        self._grams, self._block = grams, block
        null, condition = np.zeros((len(grams.scale), 0)), 1.0
        if isinstance(block, GramInverse | SparseGramInverse):
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

    def _solved(self, inside: Eliminated, block: Block, right_side: Vector) -> Vector:
        scale, touched = self._grams.scale, self._grams.touched
        right = scale * right_side
        solution, bent = np.empty(len(right)), inside.inner(right[~touched][inside.own])
        solution[touched] = block.solve(right[touched] - inside.summed(inside.transposed @ bent))
        solution[~touched] = inside.gathered(bent - inside.inner(inside.coupling @ solution[touched]))
        return scale * solution

    def _null_space(self, of_block: Vector) -> Vector:
        """Return the null vectors of A + C from those of S + C."""
        inside, touched = self._grams.eliminated, self._grams.touched
        null = np.empty((len(touched), of_block.shape[1]))
        if inside is not None and null.size:
            null[touched] = of_block
            pushed = (inside.coupling @ of_block).T
            null[~touched] = -np.column_stack([inside.gathered(inside.inner(each)) for each in pushed])
        return self._grams.scale[:, None] * null


def _dealt(comm: MPI.Comm, share: sp.csr_matrix, scale: Vector, ranks: np.ndarray) -> sp.csr_matrix | None:
    """Return rows of the sum of shares of a matrix, scaled, on some ranks, None on others. Collective."""
    entries = share.tocoo()
    values = entries.data * scale[entries.row] * scale[entries.col]
    holder = ranks[len(ranks) * entries.row.astype(np.int64) // max(1, share.shape[0])]
    row, column, value = sent(comm, holder, entries.row, entries.col, values)
    return sp.csr_matrix((value, (row, column)), shape=share.shape) if comm.rank in ranks else None
