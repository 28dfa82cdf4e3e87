"""Dirichlet preconditioner of the dual operator."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property

import numpy as np
import scipy.sparse as sp
from scipy.sparse.csgraph import connected_components

from fenics_contact.feti.factor import Factor
from fenics_contact.feti.inverse import TornInverse
from fenics_contact.feti.numbering import DualNumbering
from fenics_contact.linalg import ROUNDING, scaled_columns
from fenics_contact.qp import global_sum

#: Fraction of its diagonal added to the contact block of B D⁻¹ Bᵀ. A node in two contact pairs has more rows
#: than displacements, which makes the block singular; elsewhere so small a fraction has no effect.
REGULARISATION = 1e-4


class DirichletPreconditioner:
    """M = (B D⁻¹ Bᵀ)⁻¹ B D⁻¹ S D⁻¹ Bᵀ (B D⁻¹ Bᵀ)⁻¹, S the Schur complement of each K_s on its interface.

    D is the typical stiffness at each copy of a node, so that of two neighbours the softer one deforms.
    Gluing and Dirichlet rows are orthogonal in D⁻¹: B D⁻¹ Bᵀ is diagonal except for the rows of contacts and
    ties, where it is factored.

    References:
        Farhat, Roux: An unconventional domain decomposition method for an efficient parallel solution of
        large-scale finite element systems. SIAM J. Sci. Stat. Comput. 13 (1992) 379-396.
        Klawonn, Widlund: FETI and Neumann-Neumann iterative substructuring methods: connections and new
        results. Comm. Pure Appl. Math. 54 (2001) 57-90.
    """

    def __init__(
        self,
        inverse: TornInverse,
        B: sp.csr_matrix,
        compliance: np.ndarray,
        numbering: DualNumbering,
        n_gluing: int,
    ) -> None:
        """Factor the contact block of B D⁻¹ Bᵀ. Collective.

        Args:
            inverse: The factored subdomains.
            B: This rank's part of B on the interface, shape (n_local_rows, n_interface).
            compliance: Diagonal of D⁻¹, shape (n_interface,), the same for all components of a node.
            numbering: Owners and exchange of multipliers.
            n_gluing: Number of gluing and Dirichlet rows; rows of ties and contacts have the higher numbers.
        """
        self._inverse, self._numbering = inverse, numbering
        self._B = scaled_columns(B, compliance)
        self._Bt = self._B.T.tocsr()
        diagonal = numbering.to_owned(np.asarray(B.multiply(self._B).sum(axis=1)).ravel())
        self._equality = 1.0 / np.where(numbering.owned < n_gluing, diagonal, 1.0)
        self._contact = _ContactBlock.of_rows(B, self._B, numbering, n_gluing)

    def __call__(self, residual: np.ndarray) -> np.ndarray:
        """Return M r for an owned vector. Collective."""
        return self._apply(residual, self._contact)

    def on_face(self, restriction: sp.csr_matrix) -> PreconditionerOfFace:
        """Return the preconditioner of a face; only its rows enter B D⁻¹ Bᵀ. Collective.

        Rows that are not on the face would stiffen their neighbours, the more the stiffer the slave.

        Args:
            restriction: Z with orthonormal columns, shape (n_owned, n_face), owned.
        """
        return PreconditionerOfFace(self, self._contact.on_face(restriction))

    def lifting(self, restriction: sp.csr_matrix) -> Lifting:
        """Return the displacements of the interface that close rows of a face. Collective.

        Args:
            restriction: Z with orthonormal columns, shape (n_owned, n_face), owned.
        """
        return Lifting(self, self._contact.on_face(restriction))

    def _apply(self, residual: np.ndarray, contact: _ContactBlock) -> np.ndarray:
        return self._force(self._inverse.stiffen(self._jump(residual, contact)), contact)

    def _jump(self, residual: np.ndarray, contact: _ContactBlock) -> np.ndarray:
        """Return D⁻¹ Bᵀ (B D⁻¹ Bᵀ)⁻¹ r on the interface. Collective."""
        return self._Bt @ self._numbering.to_local(contact.solve(self._equality * residual))

    def _force(self, stiffened: np.ndarray, contact: _ContactBlock) -> np.ndarray:
        """Return the transpose of `_jump` times an interface force, owned. Collective."""
        return self._equality * contact.solve(self._numbering.to_owned(self._B @ stiffened))


@dataclass(frozen=True, eq=False)
class PreconditionerOfFace:
    """The preconditioner where only rows of a face enter B D⁻¹ Bᵀ, and where these depend on each other."""

    _preconditioner: DirichletPreconditioner
    _contact: _ContactBlock

    def __call__(self, residual: np.ndarray) -> np.ndarray:
        """Return M r for an owned vector. Collective."""
        return self._preconditioner._apply(residual, self._contact)

    def contradiction(self, residual: np.ndarray) -> tuple[np.ndarray, np.ndarray, np.ndarray, int] | None:
        """Return what no force on the face's rows changes, see `qp.RowsOfFace`. Collective."""
        return self._contact.contradiction(residual)


@dataclass(frozen=True, eq=False)
class Lifting:
    """The two factors of the preconditioner on a face, M = Lᵀ S L with L = D⁻¹ Bᵀ (B D⁻¹ Bᵀ)⁻¹.

    B L r = r on the rows of the face, up to the regularisation of the contact block.
    """

    _preconditioner: DirichletPreconditioner
    _contact: _ContactBlock

    def jump(self, residual: np.ndarray) -> np.ndarray:
        """Return L r, the interface displacement that moves rows by r, shape (n_interface,). Collective."""
        return self._preconditioner._jump(residual, self._contact)

    def multiplier(self, force: np.ndarray) -> np.ndarray:
        """Return Lᵀ times an interface force, owned. Collective."""
        return self._preconditioner._force(force, self._contact)


class _ContactBlock:
    """(B D⁻¹ Bᵀ)⁻¹ on rows of ties and contacts, by a sparse factor on every rank; others stay unchanged.

    Contact points are replicated, too; one message with a number per contact row is cheaper than the many of
    a factor that is distributed over the ranks.
    """

    def __init__(
        self,
        numbering: DualNumbering,
        n_gluing: int,
        gram: sp.csr_matrix,
        basis: sp.csr_matrix | None = None,
    ) -> None:
        """Take the matrix, or its part on the columns of a basis, shape (n_rows, n_face)."""
        self._numbering, self._n_gluing, self._gram, self._basis = numbering, n_gluing, gram, basis
        self._owned = np.flatnonzero(numbering.owned >= n_gluing)
        self._place = numbering.owned[self._owned] - n_gluing
        matrix = gram if basis is None else (basis.T @ gram @ basis).tocsr()
        self._size, self._matrix = matrix.shape[0], matrix
        self._transposed = None if basis is None else basis.T.tocsr()

    @cached_property
    def _factor(self) -> Factor:
        """Factors, on first use."""
        return _regularised(self._matrix)

    @classmethod
    def of_rows(
        cls, B: sp.csr_matrix, weighted: sp.csr_matrix, numbering: DualNumbering, n_gluing: int
    ) -> _ContactBlock:
        """Gather B D⁻¹ Bᵀ of ties and contacts on every rank. Collective."""
        mine = np.flatnonzero(numbering.local_rows >= n_gluing)
        place = numbering.local_rows[mine] - n_gluing
        share = (B[mine] @ weighted[mine].T).tocoo()
        entries = (share.data, place[share.row], place[share.col])
        value, row, column = (
            np.concatenate(part) for part in zip(*numbering.comm.allgather(entries), strict=True)
        )
        count = numbering.total - n_gluing
        return cls(numbering, n_gluing, sp.csr_matrix((value, (row, column)), shape=(count, count)))

    def on_face(self, restriction: sp.csr_matrix) -> _ContactBlock:
        """Return the block of the rows of a face. Collective."""
        mine = restriction[self._owned].tocoo()
        used, column = np.unique(mine.col, return_inverse=True)
        parts = self._numbering.comm.allgather((self._place[mine.row], column.ravel(), mine.data, len(used)))
        starts = np.cumsum([0] + [part[3] for part in parts])
        row = np.concatenate([part[0] for part in parts])
        where = np.concatenate([part[1] + start for part, start in zip(parts, starts, strict=False)])
        value = np.concatenate([part[2] for part in parts])
        basis = sp.csr_matrix((value, (row, where)), shape=(self._gram.shape[0], int(starts[-1])))
        return _ContactBlock(self._numbering, self._n_gluing, self._gram, basis)

    def solve(self, x: np.ndarray) -> np.ndarray:
        """Return the solution on these rows, zero on those that are not on the face. Collective."""
        if self._gram.shape[0] == 0:
            return x
        right, solution = self._gathered(x), np.empty(self._size)
        if self._size:
            self._factor.solve(right, solution)
        result = x.copy()
        result[self._owned] = self._scattered(solution)
        return result

    def contradiction(self, x: np.ndarray) -> tuple[np.ndarray, np.ndarray, np.ndarray, int] | None:
        """Return what no force on the columns of the face changes in x, see `qp.RowsOfFace`. Collective."""
        if self._size == 0:
            return None
        right = self._gathered(x)
        part = _dependent_part(self._matrix, self._factor, right)
        # Beside their rows, slipping discs feel the stiffness of their circle, and depend on nothing.
        alone = np.ones(self._size, dtype=bool)
        if part is not None and self._basis is not None:
            alone = np.diff(self._basis.tocsc().indptr) == 1
        if part is not None and not alone.all():
            matrix = self._matrix[alone][:, alone].tocsr()
            part = _dependent_part(matrix, _regularised(matrix), right[alone]) if alone.any() else None
        if part is None:
            return None
        excess, force, number = (np.full(self._size, empty) for empty in (0.0, 0.0, -1))
        excess[alone], force[alone], number[alone] = part
        count = int(number.max()) + 1
        group = self._scattered(number + 1.0).astype(np.int64) - 1
        parts = [np.zeros(len(x)), np.zeros(len(x)), np.full(len(x), -1)]
        for whole, own in zip(parts, (self._scattered(excess), self._scattered(-force), group), strict=True):
            whole[self._owned] = own
        return parts[0], parts[1], parts[2], count

    def _gathered(self, x: np.ndarray) -> np.ndarray:
        """Return an owned vector on all columns of the face, replicated. Collective."""
        right = np.zeros(self._gram.shape[0])
        right[self._place] = x[self._owned]
        right = global_sum(self._numbering.comm, right)
        return right if self._transposed is None else np.asarray(self._transposed @ right)

    def _scattered(self, columns: np.ndarray) -> np.ndarray:
        """Return this rank's rows of a vector on the columns of the face."""
        rows = columns if self._basis is None else self._basis @ columns
        return np.asarray(rows[self._place])


def _regularised(matrix: sp.csr_matrix) -> Factor:
    """Factor A + ε diag A; rows that supports alone determine are empty and become those of the identity."""
    diagonal = matrix.diagonal()
    share = np.where(diagonal > 0.0, REGULARISATION * diagonal, 1.0)
    return Factor((matrix + sp.diags(share)).tocsr())


def _dependent_part(
    matrix: sp.csr_matrix, regularised: Factor, right: np.ndarray
) -> tuple[np.ndarray, np.ndarray, np.ndarray] | None:
    """Return z = D N (Nᵀ D N)⁻¹ Nᵀ x with A N = 0 and D = diag A, D⁻¹ z, and coupled rows; None for zero.

    T = ε D (A + ε D)⁻¹ keeps D N and multiplies the rest by ε / (ε + its eigenvalues).

    Args:
        matrix: A, positive semidefinite, shape (n, n).
        regularised: Factors of A + ε D.
        right: x, shape (n,).

    Returns:
        Both vectors, shape (n,), and the number of the block of A that a row belongs to, −1 where z is zero.
    """
    diagonal = matrix.diagonal()
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
