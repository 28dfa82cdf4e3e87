"""Continuous corrections of lifted jumps: what copies of a node do together costs no jump, but saves energy.

A lifting that knows only the weights of copies changes from node to node where these do, at supports and at
edges between several subdomains. Across a thin layer of cells such a step costs as much more energy as the
cells are long for their thickness, and the condition number grows by that factor.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
import scipy.sparse as sp

from fenics_contact.errors import together
from fenics_contact.feti.copies import Tearing
from fenics_contact.feti.factor import Factor
from fenics_contact.feti.gluing import GluingRows
from fenics_contact.feti.inverse import TornInverse
from fenics_contact.feti.numbering import DualNumbering

#: Share of the corrections that is taken: faces, edges and corners are corrected at once, each as if the
#: others stayed.
TAKEN = 0.8


@dataclass(frozen=True, eq=False)
class ContinuousCorrection:
    """v ↦ v − θ E A⁻¹ Eᵀ K_bb v and its transpose, for displacements v of the interface.

    E moves all copies of a node together, so that no gluing row feels it; prescribed components and those of
    ties and contacts stay. K_bb is the stiffness of the interface with the inside held, and A the part of
    Eᵀ K_bb E that couples nodes of the same subdomains, those of one face or edge: one block for each, on the
    rank that owns its rows. So nothing is factored beyond a rank, and messages go to neighbours only.

    Attributes:
        numbering: Owners and exchange of multipliers; the last gluing row of a component of a node, which all
            of its copies share, stands for the component.
        summing: Eᵀ, shape (n_local_rows, n_interface): sums over copies in these rows.
        stiff: K_bb E, shape (n_interface, n_local_rows).
        free: This rank's components that move, positions in owned vectors.
        factor: Factors of A; None where nothing moves.
    """

    numbering: DualNumbering
    summing: sp.csr_matrix
    stiff: sp.csr_matrix
    free: np.ndarray
    factor: Factor | None

    @classmethod
    def build(
        cls,
        inverse: TornInverse,
        B: sp.csr_matrix,
        numbering: DualNumbering,
        gluing: GluingRows,
        tearing: Tearing,
    ) -> ContinuousCorrection | None:
        """Factor the blocks; None where no node has free copies. Collective.

        Args:
            inverse: The factored subdomains.
            B: This rank's part of B on the interface, shape (n_local_rows, n_interface).
            numbering: Owners and exchange of multipliers.
            gluing: Gluing and Dirichlet rows, the first of B.
            tearing: Copies of the nodes.
        """
        standing = _standing(gluing)
        if not standing.any():
            return None
        rows = numbering.local_rows
        glued = rows < gluing.rows.count
        stands = np.zeros(len(rows), dtype=bool)
        stands[glued] = standing[rows[glued]]
        summing = sp.csr_matrix(sp.diags(stands.astype(float)) @ (B != 0))
        stiff = (inverse.held_inside @ summing.T).tocsr()
        met = np.zeros(B.shape[1])
        met[B[~glued].indices] = 1.0
        moves = stands[: len(numbering.owned)] & (numbering.to_owned(summing @ met) == 0.0)
        free = np.flatnonzero(moves)
        blocks = _summed(numbering, summing @ stiff, _parts(rows, stands, gluing, tearing))
        with together(numbering.comm):
            factor = Factor(blocks[free][:, free].tocsr()) if len(free) else None
        return cls(numbering, summing, stiff, free, factor)

    def __call__(self, displacement: np.ndarray) -> np.ndarray:
        """Return the corrected displacement of the interface, shape (n_interface,). Collective."""
        return displacement - self.summing.T @ self._moved(self.stiff.T @ displacement)

    def transposed(self, force: np.ndarray) -> np.ndarray:
        """Return the transpose times a force on the interface, shape (n_interface,). Collective."""
        return np.asarray(force - self.stiff @ self._moved(self.summing @ force))

    def _moved(self, sums: np.ndarray) -> np.ndarray:
        """Return θ A⁻¹ times forces on components, shape (n_local_rows,), shares of each rank. Collective."""
        owned = self.numbering.to_owned(sums)
        moved = np.zeros_like(owned)
        if self.factor is not None:
            self.factor.solve(owned[self.free], solution := np.empty(len(self.free)))
            moved[self.free] = TAKEN * solution
        return self.numbering.to_local(moved)


def _standing(gluing: GluingRows) -> np.ndarray:
    """Mark the last gluing row of every component that is free and has copies, shape (n_rows,)."""
    last = np.append(gluing.dof[1:] != gluing.dof[:-1], np.ones(min(len(gluing.dof), 1), dtype=bool))
    return np.asarray(last & ~gluing.fixed.ravel()[gluing.dof])


def _parts(rows: np.ndarray, stands: np.ndarray, gluing: GluingRows, tearing: Tearing) -> np.ndarray:
    """Number the faces, edges and corners: the same number for rows of nodes of the same subdomains.

    Args:
        rows: Numbers of this rank's rows, shape (n_local_rows,).
        stands: Which of them stand for a component.
        gluing: Gluing and Dirichlet rows.
        tearing: Copies of the nodes.

    Returns:
        Shape (n_local_rows,), −1 for rows that do not stand for a component.
    """
    nodes = gluing.dof[rows[stands]] // tearing.dim
    place, copy = tearing.copies_of(nodes)
    count = tearing.multiplicity[nodes]
    around = np.full((len(nodes), int(count.max(initial=0))), -1)
    around[place, np.arange(len(place)) - np.repeat(np.cumsum(count) - count, count)] = (
        tearing.copy_subdomain[copy]
    )
    numbers = np.full(len(rows), -1)
    numbers[stands] = np.unique(around, axis=0, return_inverse=True)[1].ravel()
    return numbers


def _summed(numbering: DualNumbering, share: sp.csr_matrix, parts: np.ndarray) -> sp.csr_matrix:
    """Return the blocks of Eᵀ K_bb E in owned rows and columns, summed over the ranks. Collective."""
    entries = share.tocoo()
    inside = parts[entries.row] == parts[entries.col]
    value, row, column = (part[inside] for part in (entries.data, entries.row, entries.col))
    place = (row, numbering.local_rows[column])
    blocks = sp.csr_matrix((value, place), shape=(share.shape[0], numbering.total))
    return numbering.sum_rows(blocks)[:, numbering.owned].tocsr()
