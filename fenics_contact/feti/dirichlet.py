"""Dirichlet preconditioner of the dual operator."""

from __future__ import annotations

import numpy as np
import scipy.sparse as sp

from fenics_contact.feti.factor import Factor
from fenics_contact.feti.inverse import TornInverse
from fenics_contact.feti.numbering import DualNumbering
from fenics_contact.qp.reductions import global_sum

#: Share of its diagonal added to the contact block of B D⁻¹ Bᵀ. A node in two contact pairs has more rows
#: than displacements, which makes the block singular; elsewhere so small a share changes nothing.
REGULARISATION = 1e-4


class DirichletPreconditioner:
    """M = (B D⁻¹ Bᵀ)⁻¹ B D⁻¹ S D⁻¹ Bᵀ (B D⁻¹ Bᵀ)⁻¹, S the Schur complement of each K_s on its interface.

    D is the typical stiffness that each copy of a node feels, so that of two neighbours the softer one gives
    way. Gluing and Dirichlet rows are orthogonal in D⁻¹: B D⁻¹ Bᵀ is diagonal but for the rows of contacts
    and ties, where it is factored.

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
        self._B = (B @ sp.diags(compliance)).tocsr()
        self._Bt = self._B.T.tocsr()
        diagonal = numbering.to_owned(np.asarray(B.multiply(self._B).sum(axis=1)).ravel())
        self._equality = 1.0 / np.where(numbering.owned < n_gluing, diagonal, 1.0)
        self._contact = _ContactBlock(B, self._B, numbering, n_gluing)

    def __call__(self, residual: np.ndarray) -> np.ndarray:
        """Return M r for an owned vector. Collective."""
        jump = self._Bt @ self._numbering.to_local(self._unweighted(residual))
        force = self._B @ self._inverse.stiffen(jump)
        return self._unweighted(self._numbering.to_owned(force))

    def _unweighted(self, x: np.ndarray) -> np.ndarray:
        """Return (B D⁻¹ Bᵀ)⁻¹ x, owned. Collective."""
        return self._contact.solve(self._equality * x)


class _ContactBlock:
    """(B D⁻¹ Bᵀ)⁻¹ on contact rows by a sparse factor on every rank; other rows stay as they are.

    Contact points are replicated as well; a message of one number a contact row is cheaper than the many of a
    factor that is spread over the ranks.
    """

    def __init__(
        self, B: sp.csr_matrix, weighted: sp.csr_matrix, numbering: DualNumbering, n_gluing: int
    ) -> None:
        self._comm = numbering.comm
        self._owned = np.flatnonzero(numbering.owned >= n_gluing)
        self._place = numbering.owned[self._owned] - n_gluing
        self._count = numbering.total - n_gluing
        if self._count == 0:
            return
        mine = np.flatnonzero(numbering.local_rows >= n_gluing)
        place = numbering.local_rows[mine] - n_gluing
        share = (B[mine] @ weighted[mine].T).tocoo()
        entries = (share.data, place[share.row], place[share.col])
        value, row, column = (
            np.concatenate(part) for part in zip(*self._comm.allgather(entries), strict=True)
        )
        gram = sp.csr_matrix((value, (row, column)), shape=(self._count, self._count))
        self._factor = Factor((gram + REGULARISATION * sp.diags(gram.diagonal())).tocsr())

    def solve(self, x: np.ndarray) -> np.ndarray:
        if self._count == 0:
            return x
        right, solution = np.zeros(self._count), np.empty(self._count)
        right[self._place] = x[self._owned]
        self._factor.solve(global_sum(self._comm, right), solution)
        result = x.copy()
        result[self._owned] = solution[self._place]
        return result
