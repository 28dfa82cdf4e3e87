"""Dirichlet preconditioner of the dual operator."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Protocol

import numpy as np
import scipy.sparse as sp
from petsc4py import PETSc

from fenics_contact.feti.factor import Factor
from fenics_contact.feti.numbering import DualNumbering
from fenics_contact.feti.subdomain import Subdomain

#: Share of its diagonal added to the contact block of B Bᵀ. A node in two contact pairs has more rows than
#: displacements, which makes the block singular; elsewhere so small a share changes nothing.
REGULARISATION = 1e-4


class DirichletPreconditioner:
    """M = (B Bᵀ)⁻¹ B S Bᵀ (B Bᵀ)⁻¹, S the Schur complement of each K_s on the dofs that B touches.

    Gluing and Dirichlet rows are orthonormal, so that B Bᵀ differs from the identity only on the contact
    rows, where it is factored.

    References:
        Farhat, Roux: An unconventional domain decomposition method for an efficient parallel solution of
        large-scale finite element systems. SIAM J. Sci. Stat. Comput. 13 (1992) 379-396.
    """

    def __init__(
        self, subdomains: Sequence[Subdomain], B: sp.csr_matrix, numbering: DualNumbering, n_equality: int
    ) -> None:
        """Factor the interior of every subdomain and the contact block of B Bᵀ. Collective."""
        self._B, self._Bt, self._numbering = B, B.T.tocsr(), numbering
        touched = np.zeros(B.shape[1], dtype=bool)
        touched[np.unique(B.indices)] = True
        self._schur = []
        start = 0
        for subdomain in subdomains:
            stop = start + subdomain.mesh.size
            self._schur.append(
                (slice(start, stop), _schur_complement(subdomain.stiffness, touched[start:stop]))
            )
            start = stop
        self._contact = _ContactBlock(B, numbering, n_equality)

    def __call__(self, residual: np.ndarray) -> np.ndarray:
        """Return M r for an owned vector. Collective."""
        jump = self._Bt @ self._numbering.to_local(self._contact.solve(residual))
        force = np.empty_like(jump)
        for part, schur in self._schur:
            force[part] = schur(jump[part])
        return self._contact.solve(self._numbering.to_owned(self._B @ force))


class _Apply(Protocol):
    def __call__(self, displacement: np.ndarray) -> np.ndarray: ...


def _schur_complement(stiffness: sp.csr_matrix, boundary: np.ndarray) -> _Apply:
    """Return v ↦ S v, S = K_bb − K_bi K_ii⁻¹ K_ib, for vectors that vanish inside."""
    b, i = np.flatnonzero(boundary), np.flatnonzero(~boundary)
    Kb = stiffness[b]
    Kbb, Kbi = Kb[:, b].tocsr(), Kb[:, i].tocsr()
    Kib = Kbi.T.tocsr()
    interior = Factor(stiffness[i][:, i].tocsr()) if len(i) else None
    inner = np.zeros(len(i))

    def apply(displacement: np.ndarray) -> np.ndarray:
        force = np.zeros_like(displacement)
        v = displacement[b]
        force[b] = Kbb @ v
        if interior is not None:
            interior.solve(Kib @ v, inner)
            force[b] -= Kbi @ inner
        return force

    return apply


class _ContactBlock:
    """(B Bᵀ)⁻¹: the identity on equality rows, a sparse factor on contact rows."""

    def __init__(self, B: sp.csr_matrix, numbering: DualNumbering, n_equality: int) -> None:
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
        gram = (B[mine] @ B[mine].T).tocoo()
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

    def solve(self, x: np.ndarray) -> np.ndarray:
        if self._ksp is None:
            return x
        result = x.copy()
        self._right.array_w[:] = x[self._owned]
        self._ksp.solve(self._right, self._left)
        result[self._owned] = self._left.array_r
        return result
