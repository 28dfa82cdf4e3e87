"""The block of contacts and ties in B D⁻¹ Bᵀ, held by one rank, and its inverse."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property

import numpy as np
import scipy.sparse as sp
from scipy.sparse.csgraph import connected_components

from fenics_contact._base.costs import count_flops, count_messages
from fenics_contact._base.csr import Csr
from fenics_contact._base.libraries import MPI
from fenics_contact._base.sparse import ROUNDING
from fenics_contact.errors import together
from fenics_contact.feti.decomposition import DualNumbering
from fenics_contact.feti.factor import Factor, NoFactor

#: Fraction of its diagonal added to the contact block of B D⁻¹ Bᵀ. A node in two contact pairs has more rows
#: than displacements, which makes the block singular; elsewhere so small a fraction has no effect.
REGULARISATION = 1e-4


@dataclass(frozen=True, eq=False)
class _Holder:
    """The way from the ranks that own rows of contacts and ties to the one that holds their matrix, and back.

    `rank`: the rank that holds the matrix: the one that owns most of the rows; `owned`: positions of this
    rank's rows in its owned vectors; `place`: their numbers among all these rows; `order`: on the holder
    numbers of all rows, rank by rank.
    """

    comm: MPI.Comm
    rank: int
    owned: np.ndarray
    place: np.ndarray
    order: np.ndarray
    counts: np.ndarray

    @classmethod
    def of(cls, numbering: DualNumbering, n_gluing: int) -> _Holder:
        """Choose the rank for the rows after the gluing ones."""
        owner, comm = numbering.owner[n_gluing:], numbering.comm
        counts = np.bincount(owner, minlength=comm.size)
        owned = np.flatnonzero(numbering.owned >= n_gluing)
        rank = int(counts.argmax())
        order = np.argsort(owner, kind="stable") if comm.rank == rank else np.zeros(0, dtype=np.int64)
        return cls(comm, rank, owned, numbering.owned[owned] - n_gluing, order, counts)

    @property
    def holds(self) -> bool:
        """Whether it is this rank."""
        return self.comm.rank == self.rank

    def gathered(self, x: np.ndarray) -> np.ndarray:
        """Return the rows of an owned vector, shape (n_rows,) on the holder, empty elsewhere. Collective."""
        mine, received = np.ascontiguousarray(x[self.owned]), np.empty(len(self.order))
        self._count()
        self.comm.Gatherv(mine, (received, self.counts) if self.holds else None, root=self.rank)
        rows = np.empty(len(self.order))
        rows[self.order] = received
        return rows

    def scattered(self, rows: np.ndarray) -> np.ndarray:
        """Return this rank's part of what the holder has, shape (n_rows,) there. Collective."""
        part = np.empty(len(self.owned))
        self._count()
        self.comm.Scatterv((rows[self.order], self.counts) if self.holds else None, part, root=self.rank)
        return part

    def _count(self) -> None:
        """Count the messages of a call: one with each of the others that own rows."""
        alone = self.counts.sum() - self.counts[self.rank]
        if self.holds:
            count_messages(self.comm, (np.count_nonzero(self.counts) - 1, 8 * int(alone)))
        else:
            count_messages(self.comm, (int(len(self.owned) > 0), 8 * len(self.owned)))

    def joined(self, *columns: np.ndarray) -> list[tuple[np.ndarray, ...]]:
        """Return the columns that all ranks give, rank by rank, on the holder, else nothing. Collective."""
        return self.comm.gather(columns, root=self.rank) or []


class ContactBlock:
    """(B D⁻¹ Bᵀ)⁻¹ on rows of ties and contacts, by a sparse factor on one rank; others stay unchanged.

    Only ranks that own such rows exchange numbers with it, one for each row.
    """

    def __init__(self, holder: _Holder, gram: sp.csr_matrix, soft: np.ndarray) -> None:
        """Take the matrix, and marks of rows that give way; empty on other ranks than the holder."""
        self._holder, self._gram, self._soft = holder, gram, soft
        self._matrix = self._on_columns()
        self._size = self._matrix.shape[0]

    def _on_columns(self) -> sp.csr_matrix:
        """Return the matrix of the columns."""
        return self._gram

    @cached_property
    def _factor(self) -> Factor | NoFactor:
        """Factors, on first use; none on other ranks, and without any columns. Collective then."""
        with together(self._holder.comm):
            return _regularised(self._matrix, self._sizes) if self._size else NoFactor()

    @cached_property
    def _sizes(self) -> np.ndarray:
        """Diagonal of the block."""
        return np.asarray(self._gram.diagonal())

    @classmethod
    def of_rows(
        cls, B: sp.csr_matrix, weighted: sp.csr_matrix, numbering: DualNumbering, n_gluing: int
    ) -> ContactBlock:
        """Add up B D⁻¹ Bᵀ of ties and contacts on one rank. Collective."""
        mine = np.flatnonzero(numbering.local_rows >= n_gluing)
        place = numbering.local_rows[mine] - n_gluing
        share = (B[mine] @ weighted[mine].T).tocoo()
        holder = _Holder.of(numbering, n_gluing)
        parts = holder.joined(share.data, place[share.row], place[share.col])
        if not parts:
            return cls(holder, Csr((0, 0)), np.zeros(0, dtype=bool))
        value, row, column = (np.concatenate(part) for part in zip(*parts, strict=True))
        count = numbering.total - n_gluing
        gram = Csr((value, (row, column)), shape=(count, count))
        return cls(holder, gram, np.zeros(count, dtype=bool))

    def on_face(self, restriction: sp.csr_matrix) -> ContactBlock:
        """Return the block of the rows of a face. Collective."""
        mine = restriction[self._holder.owned].tocoo()
        _, column = np.unique(mine.col, return_inverse=True)
        parts = self._holder.joined(self._holder.place[mine.row], column.ravel(), mine.data)
        basis = Csr((0, 0))
        if parts:
            starts = np.cumsum([0] + [part[1].max(initial=-1) + 1 for part in parts])
            row, value = (np.concatenate([part[k] for part in parts]) for k in (0, 2))
            where = np.concatenate([part[1] + start for part, start in zip(parts, starts, strict=False)])
            basis = Csr((value, (row, where)), shape=(self._gram.shape[0], int(starts[-1])))
        return _BlockOfFace(self._holder, self._gram, self._soft, basis)

    def softened(self, compliance: np.ndarray) -> ContactBlock:
        """Return the block B D⁻¹ Bᵀ + C of rows that give way, which contradict no other. Collective.

        `compliance`: C on all rows, owned, zero on those that do not.
        """
        added = self._holder.gathered(compliance)
        return ContactBlock(self._holder, (self._gram + sp.diags(added)).tocsr(), added > 0.0)

    def solve(self, x: np.ndarray) -> np.ndarray:
        """Return the solution on these rows, zero on those that are not on the face. Collective."""
        if not self._holder.counts.any():
            return x
        factor, right = self._factor, self._gathered(x)
        solution = np.empty(self._size)
        count_flops(self._holder.comm, 4 * factor.entries)
        factor.solve(right, solution)
        result = x.copy()
        result[self._holder.owned] = self._scattered(solution)
        return result

    def contradiction(self, x: np.ndarray) -> tuple[np.ndarray, np.ndarray, np.ndarray, int] | None:
        """Return what no force on the columns of the face changes in x, see `qp.RowsOfFace`. Collective."""
        if not self._holder.counts.any():
            return None
        factor, right, comm = self._factor, self._gathered(x), self._holder.comm
        with together(comm):
            part = self._dependent(factor, right) if self._size else None
        count = 0 if part is None else int(part[2].max()) + 1
        count = comm.bcast(count, root=self._holder.rank)
        if count == 0:
            return None
        nothing = (np.zeros(0), np.zeros(0), np.zeros(0))
        excess, force, number = (self._scattered(each) for each in part or nothing)
        parts = [np.zeros(len(x)), np.zeros(len(x)), np.full(len(x), -1)]
        for whole, own in zip(parts, (excess, -force, number.astype(np.int64) - 1), strict=True):
            whole[self._holder.owned] = own
        return parts[0], parts[1], parts[2], count

    def _dependent(
        self, factor: Factor | NoFactor, right: np.ndarray
    ) -> tuple[np.ndarray, np.ndarray, np.ndarray] | None:
        """Return `_dependent_part` of all columns, with numbers from one, 0 where nothing is left."""
        part = _dependent_part(self._matrix, factor, right, self._sizes)
        if part is None or not (alone := self._may_depend).any():
            return None
        if not alone.all():
            matrix, sizes = self._matrix[alone][:, alone].tocsr(), self._sizes[alone]
            part = _dependent_part(matrix, _regularised(matrix, sizes), right[alone], sizes)
            if part is None:
                return None
        excess, force, number = (np.zeros(self._size) for _ in range(3))
        excess[alone], force[alone], number[alone] = part[0], part[1], part[2] + 1.0
        return excess, force, number

    @property
    def _may_depend(self) -> np.ndarray:
        """Marks of columns that may depend on others."""
        return ~self._soft

    def _gathered(self, x: np.ndarray) -> np.ndarray:
        """Return an owned vector on all columns, on the holder. Collective."""
        return self._holder.gathered(x)

    def _scattered(self, columns: np.ndarray) -> np.ndarray:
        """Return this rank's rows of a vector on the columns. Collective."""
        return self._holder.scattered(columns)


class _BlockOfFace(ContactBlock):
    """The part on the columns of a basis, shape (n_rows, n_face), empty on other ranks than the holder."""

    def __init__(self, holder: _Holder, gram: sp.csr_matrix, soft: np.ndarray, basis: sp.csr_matrix) -> None:
        self._basis, self._transposed = basis, basis.T.tocsr()
        super().__init__(holder, gram, soft)

    def _on_columns(self) -> sp.csr_matrix:
        return (self._basis.T @ self._gram @ self._basis).tocsr()

    @cached_property
    def _sizes(self) -> np.ndarray:
        # On the offset of a slipping disc that of the disc, of which the diagonal may be 0.
        diagonal, columns = self._gram.diagonal(), self._basis.tocsc()
        return np.maximum.reduceat(diagonal[columns.indices], columns.indptr[:-1])

    @property
    def _may_depend(self) -> np.ndarray:
        # Beside their rows, slipping discs feel the stiffness of their circle, and depend on nothing.
        return (np.diff(self._basis.tocsc().indptr) == 1) & (self._transposed @ self._soft == 0.0)

    def _gathered(self, x: np.ndarray) -> np.ndarray:
        return np.asarray(self._transposed @ self._holder.gathered(x))

    def _scattered(self, columns: np.ndarray) -> np.ndarray:
        return self._holder.scattered(np.asarray(self._basis @ columns))


def _regularised(matrix: sp.csr_matrix, sizes: np.ndarray) -> Factor:
    """Factor A + ε D; rows that supports alone determine are empty and become those of the identity.

    `sizes`: D, at least the diagonal of A.
    """
    share = np.where(sizes > 0.0, REGULARISATION * sizes, 1.0)
    return Factor((matrix + sp.diags(share)).tocsr())


def _dependent_part(
    matrix: sp.csr_matrix, regularised: Factor | NoFactor, right: np.ndarray, diagonal: np.ndarray
) -> tuple[np.ndarray, np.ndarray, np.ndarray] | None:
    """Return z = D N (Nᵀ D N)⁻¹ Nᵀ x with A N = 0, D⁻¹ z, and coupled rows; None for zero.

    T = ε D (A + ε D)⁻¹ keeps D N and multiplies the rest by ε / (ε + its eigenvalues). Returns both vectors,
    shape (n,), and the number of the block of A that a row belongs to, −1 where z is zero. `matrix`: A,
    positive semidefinite; `right`: x; `diagonal`: D.
    """
    left = np.where(diagonal > 0.0, right, 0.0)
    least, force = ROUNDING * np.abs(left).max(), np.zeros(len(left))
    for _ in range(30):
        before = left
        regularised.solve(before, force)
        left = REGULARISATION * diagonal * force
        if np.abs(left).max() <= least:
            return None
        if np.abs(before - left).max() <= ROUNDING / REGULARISATION * np.abs(left).max():
            break
    count, number = connected_components(matrix, directed=False)
    size, moved = np.zeros(count), np.zeros(count)
    np.maximum.at(size, number, np.abs(left))
    np.maximum.at(moved, number, np.abs(before - left))
    dependent = (size > least) & (moved <= ROUNDING / REGULARISATION * size)
    if not dependent.any():
        return None
    kept = dependent[number]
    return np.where(kept, left, 0.0), np.where(kept, REGULARISATION * force, 0.0), np.where(kept, number, -1)
