"""What copies of nodes move by together, so that neighbours that follow a jump are strained little.

A jump r of gluing and Dirichlet rows is met by z = D⁻¹ Bᵀ (B D⁻¹ Bᵀ)⁻¹ r with a diagonal D, node by node.
Where cells are much flatter than wide, as where they are graded towards a plane of symmetry, two nodes across
a cell are stiffly coupled, and shares that differ strain it: a node on a support follows its whole jump, the
next one half of it. Displacements N y that all copies of a node have in common change no jump. The energy of
the interface with the inside held,

    ½ (z − N y)ᵀ K_bb (z − N y),   A y = Nᵀ K_bb z,   A = Nᵀ K_bb N,

is least at the solution y; instead of it a few damped sweeps suffice, with the blocks Â of A on the nodes
that the same subdomains share: faces, edges and vertices between subdomains. These are sparse, and each is
factored by the rank that owns its rows. K_bb in place of S makes it deluxe scaling without dense matrices.

References:
    O. B. Widlund, C. R. Dohrmann, BDDC deluxe domain decomposition, Domain Decomposition Methods in Science
    and Engineering XXII, Springer (2016) 93-103.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import ClassVar

import numpy as np
import scipy.sparse as sp

from fenics_contact._base.costs import count_flops
from fenics_contact.errors import together
from fenics_contact.feti.decomposition import DualNumbering, Tearing
from fenics_contact.feti.factor import Factor, NoFactor
from fenics_contact.feti.torn import TornSystem


class NotSewn:
    """Copies move by what closes their own rows alone."""

    def eased(self, displacement: np.ndarray) -> np.ndarray:
        """Return an interface displacement as it is."""
        return displacement

    def eased_transposed(self, force: np.ndarray) -> np.ndarray:
        """Return an interface force as it is."""
        return force


NOT_SEWN = NotSewn()


@dataclass(frozen=True, eq=False)
class Sewing(NotSewn):
    """z ↦ z − N Q Nᵀ K_bb z with Q the sweeps for A⁻¹.

    Displacements y belong to rows: the last gluing row of a component of a node, which touches all its
    copies, has the one of that component; all others are zero. `moved`: N, (n_interface, n_local_rows);
    `forces`: K_bb N; `share`: this rank's part of A; `sewn`: positions of the owned rows with a y; `blocks`:
    factors of Â on these; `sweeps`: number of sweeps.
    """

    #: Coupling of neighbours from which it pays, see `TornInverse.strongest_coupling`: hexahedra three times
    #: as wide as high. Cubes have 0.3 to 0.45: their blocks take 1.95 with it in place of 1.58 s.
    coupled: ClassVar[float] = 0.65
    #: What is taken of each sweep. Chain, ball and blocks need the fewest products with two; one of full
    #: length 24, 32 and 17 in place of 23, 26 and 14, an exact A⁻¹ 24, 24 and 15.
    damping: ClassVar[float] = 0.6
    #: Coupling from which a third sweep pays: a graded ball of tetrahedra, 0.95, takes 55 products with it,
    #: 81 without and 50 with an exact A⁻¹; one of hexahedra, 0.83, 41, 47 and 41; the chain, 0.71, 46 and 41.
    stiff: ClassVar[float] = 0.8

    numbering: DualNumbering
    moved: sp.csr_matrix
    forces: sp.csr_matrix
    share: sp.csr_matrix
    sewn: np.ndarray
    blocks: Factor | NoFactor
    sweeps: int

    @classmethod
    def of(cls, torn: TornSystem, B: sp.csr_matrix, stiffness: sp.csr_matrix, coupling: float) -> NotSewn:
        """Return that of a torn system. Collective.

        `B`: its rows on the interface, shape (n_local_rows, n_interface); `stiffness`: K_bb of this rank's
        subdomains; `coupling`: the strongest of neighbours on all ranks.
        """
        numbering = torn.numbering
        rows = np.flatnonzero(_carriers(torn, B))
        entries = B[rows]
        entries = np.ones(entries.nnz), (entries.indices, np.repeat(rows, np.diff(entries.indptr)))
        moved = sp.csr_matrix(entries, shape=B.T.shape)
        forces = (stiffness @ moved).tocsr()
        share = (moved.T @ forces).tocsr()
        own = np.flatnonzero(rows < len(numbering.owned))
        sewn = rows[own]
        if not numbering.comm.allreduce(len(sewn)):
            return NOT_SEWN
        nodes = torn.decomposition.gluing.dof[numbering.local_rows[rows]] // torn.components
        shared_by = np.full(len(numbering.local_rows), -1)
        shared_by[rows] = _sharers(torn.decomposition.tearing, nodes)
        within = share.tocoo()
        inside = shared_by[within.row] == shared_by[within.col]
        row, column, value = (each[inside] for each in (within.row, within.col, within.data))
        columns = numbering.local_rows[column]
        blocks = sp.csr_matrix((value, (row, columns)), shape=(len(numbering.local_rows), numbering.total))
        blocks = numbering.sum_rows(blocks)[sewn][:, numbering.owned[sewn]].tocsr()
        with together(numbering.comm):
            factor = Factor(blocks) if len(sewn) else NoFactor()
        sweeps = 2 + int(coupling >= cls.stiff)
        return cls(numbering, moved, forces, share, sewn, factor, sweeps)

    def eased(self, displacement: np.ndarray) -> np.ndarray:
        """Return an interface displacement with the same jumps that strains bodies less. Collective."""
        pulled = self.numbering.to_owned(self.forces.T @ displacement)
        return displacement - self.moved @ self.numbering.to_local(self._solved(pulled))

    def eased_transposed(self, force: np.ndarray) -> np.ndarray:
        """Return the transpose of `eased` times an interface force. Collective."""
        pulled = self.numbering.to_owned(self.moved.T @ force)
        return force - self.forces @ self.numbering.to_local(self._solved(pulled))

    def _solved(self, pulled: np.ndarray) -> np.ndarray:
        """Return Q times forces, both owned. Collective."""
        numbering = self.numbering
        swept = (self.sweeps - 1) * self.share.nnz + 2 * self.sweeps * self.blocks.entries
        work = self.moved.nnz + self.forces.nnz + swept
        count_flops(numbering.comm, 2 * work)
        total, left = self._sweep(pulled), pulled
        for _ in range(1, self.sweeps):
            left = pulled - numbering.to_owned(self.share @ numbering.to_local(total))
            total = total + self._sweep(left)
        return total

    def _sweep(self, left: np.ndarray) -> np.ndarray:
        """Return a part of Â⁻¹ times forces, both owned."""
        moved, found = np.zeros_like(left), np.empty(len(self.sewn))
        self.blocks.solve(left[self.sewn], found)
        moved[self.sewn] = self.damping * found
        return moved


def _carriers(torn: TornSystem, B: sp.csr_matrix) -> np.ndarray:
    """Return marks of the local rows that have a y. Collective.

    They are the last rows of what is only glued, along an axis of the coordinates. Nodes in other
    rows stay where these are closed.
    """
    numbering, gluing = torn.numbering, torn.decomposition.gluing
    local = numbering.local_rows
    last = np.zeros(numbering.total, dtype=bool)
    last[: torn.n_gluing] = np.diff(gluing.dof, append=-1) != 0
    last[: torn.n_gluing] &= ~gluing.fixed.ravel()[gluing.dof]
    if gluing.axes:
        last[: torn.n_gluing] &= gluing.axes.place(gluing.dof // torn.components) < 0
    others = np.zeros(B.shape[1])
    others[B[np.flatnonzero(local >= torn.n_gluing)].indices] = 1.0
    pattern = sp.csr_matrix((np.ones(B.nnz), B.indices, B.indptr), shape=B.shape)
    touched = numbering.to_local(numbering.to_owned(pattern @ others))
    return last[local] & (touched == 0.0)


def _sharers(tearing: Tearing, nodes: np.ndarray) -> np.ndarray:
    """Return numbers of the sets of subdomains that share nodes, shape (n,)."""
    number, found = np.empty(len(nodes), dtype=np.int64), 0
    for copies in np.unique(tearing.multiplicity[nodes]):
        here = np.flatnonzero(tearing.multiplicity[nodes] == copies)
        sets = tearing.copy_subdomain[tearing.first_copy[nodes[here], None] + np.arange(copies)]
        _, which = np.unique(sets, axis=0, return_inverse=True)
        number[here] = found + which.ravel()
        found += int(which.max()) + 1
    return number
