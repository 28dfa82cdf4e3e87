"""Dirichlet preconditioner of the dual operator."""

from __future__ import annotations

import numpy as np
import scipy.sparse as sp
from petsc4py import PETSc

from fenics_contact.feti.inverse import TornInverse
from fenics_contact.feti.numbering import DualNumbering
from fenics_contact.linalg import dispose_with

#: Share of its diagonal added to the contact block of B D⁻¹ Bᵀ. A node in two contact pairs has more rows
#: than displacements, which makes the block singular; elsewhere so small a share changes nothing.
REGULARISATION = 1e-4


class DirichletPreconditioner:
    """M = (B D⁻¹ Bᵀ)⁻¹ B D⁻¹ S D⁻¹ Bᵀ (B D⁻¹ Bᵀ)⁻¹, S the Schur complement of each K_s on its interface.

    D is a typical stiffness of each body, so that of two bodies in contact the softer one gives way. Gluing
    and Dirichlet rows are orthonormal and stay within a body: B D⁻¹ Bᵀ is diagonal but for the contact rows,
    where it is factored.

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
        n_equality: int,
    ) -> None:
        """Factor the contact block of B D⁻¹ Bᵀ. Collective.

        Args:
            inverse: The factored subdomains.
            B: This rank's part of B on the interface, shape (n_local_rows, n_interface).
            compliance: Diagonal of D⁻¹, shape (n_interface,), the same for all copies of a node.
            numbering: Owners and exchange of multipliers.
            n_equality: Number of gluing and Dirichlet rows; contact rows have the higher numbers.
        """
        self._inverse, self._numbering = inverse, numbering
        self._B = (B @ sp.diags(compliance)).tocsr()
        self._Bt = self._B.T.tocsr()
        diagonal = numbering.to_owned(B.multiply(self._B).sum(axis=1).A1)
        self._equality = 1.0 / np.where(numbering.owned < n_equality, diagonal, 1.0)
        self._contact = _ContactBlock(B, self._B, numbering, n_equality)

    def __call__(self, residual: np.ndarray) -> np.ndarray:
        """Return M r for an owned vector. Collective."""
        jump = self._Bt @ self._numbering.to_local(self._unweighted(residual))
        force = self._B @ self._inverse.stiffen(jump)
        return self._unweighted(self._numbering.to_owned(force))

    def _unweighted(self, x: np.ndarray) -> np.ndarray:
        """Return (B D⁻¹ Bᵀ)⁻¹ x, owned. Collective."""
        return self._contact.solve(self._equality * x)


class _ContactBlock:
    """(B D⁻¹ Bᵀ)⁻¹ on contact rows by a sparse factor; other rows stay as they are."""

    def __init__(
        self, B: sp.csr_matrix, weighted: sp.csr_matrix, numbering: DualNumbering, n_equality: int
    ) -> None:
        comm = numbering.comm
        rows = numbering.local_rows
        mine = np.flatnonzero(rows >= n_equality)
        self._owned = np.flatnonzero(numbering.owned >= n_equality)
        self._ksp = None
        count = numbering.total - n_equality
        if count == 0:
            return
        # Columns are the contact rows' positions among themselves, rank by rank, as PETSc numbers them.
        starts = np.cumsum([0, *comm.allgather(len(self._owned))])
        place = np.zeros(count)
        place[numbering.owned[self._owned] - n_equality] = starts[comm.rank] + np.arange(len(self._owned))
        place = np.asarray(comm.allreduce(place))[rows[mine] - n_equality].astype(PETSc.IntType)
        gram = (B[mine] @ weighted[mine].T).tocoo()
        gram.data[gram.row == gram.col] *= 1.0 + REGULARISATION
        shape = (len(rows), count)
        gram = numbering.sum_rows(sp.csr_matrix((gram.data, (mine[gram.row], place[gram.col])), shape=shape))
        gram = gram[self._owned].tocsr()
        size = (len(self._owned), count)
        csr = (gram.indptr.astype(PETSc.IntType), gram.indices.astype(PETSc.IntType), gram.data)
        matrix = PETSc.Mat().createAIJ((size, size), csr=csr, comm=comm)
        self._ksp = PETSc.KSP().create(comm)
        self._ksp.setOperators(matrix)
        self._ksp.setType(PETSc.KSP.Type.PREONLY)
        pc = self._ksp.getPC()
        pc.setType(PETSc.PC.Type.LU)
        pc.setFactorSolverType("mumps")
        self._ksp.setUp()
        self._right, self._left = matrix.createVecs()
        dispose_with(self, self._right, self._left, pc, self._ksp, matrix, comm=comm)

    def solve(self, x: np.ndarray) -> np.ndarray:
        if self._ksp is None:
            return x
        result = x.copy()
        self._right.array_w[:] = x[self._owned]
        self._ksp.solve(self._right, self._left)
        result[self._owned] = self._left.array_r
        return result
