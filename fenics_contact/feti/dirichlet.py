"""Dirichlet preconditioner of the dual operator."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from functools import cached_property

import numpy as np
import scipy.sparse as sp

from fenics_contact.feti.factor import Factor
from fenics_contact.feti.inverse import TornInverse
from fenics_contact.feti.numbering import DualNumbering
from fenics_contact.linalg import scaled_columns
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

    def on_face(self, restriction: sp.csr_matrix) -> Callable[[np.ndarray], np.ndarray]:
        """Return the preconditioner of a face; only its rows enter B D⁻¹ Bᵀ. Collective.

        Rows that are not on the face would stiffen their neighbours, the more the stiffer the slave.

        Args:
            restriction: Z with orthonormal columns, shape (n_owned, n_face), owned.
        """
        contact = self._contact.on_face(restriction)
        return lambda residual: self._apply(residual, contact)

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
        diagonal = self._matrix.diagonal()
        # Rows that supports alone determine are empty.
        share = np.where(diagonal > 0.0, REGULARISATION * diagonal, 1.0)
        return Factor((self._matrix + sp.diags(share)).tocsr())

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
        right = np.zeros(self._gram.shape[0])
        right[self._place] = x[self._owned]
        right = global_sum(self._numbering.comm, right)
        right = right if self._transposed is None else self._transposed @ right
        solution = np.empty(self._size)
        if self._size:
            self._factor.solve(right, solution)
        solution = solution if self._basis is None else self._basis @ solution
        result = x.copy()
        result[self._owned] = solution[self._place]
        return result
