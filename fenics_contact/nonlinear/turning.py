"""Forces that turn with their surfaces: how they change as these do."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from itertools import pairwise
from typing import TYPE_CHECKING

import numpy as np
import scipy.sparse as sp

from fenics_contact.display import displayed
from fenics_contact.feti import Decomposition, TornSystem
from fenics_contact.linalg import ROUNDING, scaled_columns
from fenics_contact.qp import Vector

if TYPE_CHECKING:
    from fenics_contact.pairing import GeometricStiffness

_NONE = np.zeros(0, dtype=np.int64)


@displayed
@dataclass(frozen=True, eq=False)
class UnevenStiffness:
    """An unsymmetric stiffness L Rᵀ of few columns.

    Attributes:
        left: L, shape (n_dofs, k); dof dim · node + component of all nodes.
        right: R, shape (n_dofs, k), [force / length].
        owner: Node whose rank owns the rows of a column, shape (k,).
    """

    left: sp.csr_matrix
    right: sp.csr_matrix
    owner: np.ndarray


@displayed
@dataclass(frozen=True, eq=False)
class LackingRows:
    """What rows of contact lack to be derivatives of gap and slip.

    Attributes:
        columns: Of each such row, shape (n_dofs, m); dof dim · node + component of all nodes.
        completed: Number of the row that lacks it among those of contact, shape (m,).
        owner: Node whose rank owns both, shape (m,).
    """

    columns: sp.csr_matrix
    completed: np.ndarray
    owner: np.ndarray

    @classmethod
    def of(cls, rows: sp.csr_matrix, owner: np.ndarray) -> LackingRows:
        """Return those of rows of contact that lack something.

        Args:
            rows: What each row of contact lacks, zero where it is the derivative, shape (n, n_dofs).
            owner: Node whose rank owns each row, shape (n,).
        """
        completed = np.flatnonzero(_lengths(rows.T.tocsr()) > ROUNDING)
        return cls(rows[completed].T.tocsr(), completed, owner[completed])


@displayed
@dataclass(frozen=True, eq=False)
class TurningForces:
    """How forces change as surfaces turn under them, at fixed multipliers, and gaps beside their rows.

    Attributes:
        normal: Of the normal forces of contact, symmetric; None where contact points do not move.
        normal_owner: Node whose rank owns the row of each of its columns.
        acting: Directions of changes of friction forces and pressures, columns of length one, shape (n_dofs,
            k).
        felt: The displacements that change them, columns of length one, shape (n_dofs, k).
        stiffness: Change of force for a displacement of one, shape (k,), [force / length].
        owner: Node whose rank owns the rows of each of these, shape (k,).
        lacking: What rows of contact lack; None where contact points do not move.
    """

    normal: GeometricStiffness | None
    normal_owner: np.ndarray
    acting: sp.csr_matrix
    felt: sp.csr_matrix
    stiffness: np.ndarray
    owner: np.ndarray
    lacking: LackingRows | None

    @classmethod
    def of(
        cls,
        normal: GeometricStiffness | None,
        others: Sequence[UnevenStiffness],
        normal_owner: np.ndarray = _NONE,
        lacking: LackingRows | None = None,
    ) -> TurningForces:
        """Return those of several stiffnesses, with at least one unsymmetric one."""
        others = [each for each in others if each.left.shape[1]] or others[:1]
        L, R = (_beside([getattr(each, side) for each in others]) for side in ("left", "right"))
        owner = np.concatenate([each.owner for each in others])
        left, right = _lengths(L), _lengths(R)
        kept = np.flatnonzero(left * right > ROUNDING * (left * right).max(initial=0.0))
        acting, felt = (
            scaled_columns(columns[:, kept], 1.0 / lengths[kept])
            for columns, lengths in ((L, left), (R, right))
        )
        return cls(normal, normal_owner, acting, felt, (left * right)[kept], owner[kept], lacking)

    @property
    def compliance(self) -> np.ndarray:
        """Of the rows of normal forces, of either sign, shape (m,), [length / force]."""
        return np.zeros(0) if self.normal is None else 1.0 / self.normal.values

    @property
    def count(self) -> int:
        """Number of rows: one for each value of `normal`, two for each other stiffness, what rows lack."""
        return len(self.compliance) + 2 * len(self.stiffness) + len(self.completed)

    @property
    def completed(self) -> np.ndarray:
        """Numbers of rows of contact that lack something, shape (m,)."""
        return _NONE if self.lacking is None else self.lacking.completed


def _beside(parts: Sequence[sp.csr_matrix]) -> sp.csr_matrix:
    return parts[0] if len(parts) == 1 else sp.hstack(parts, "csr")


def _lengths(columns: sp.csr_matrix) -> np.ndarray:
    return np.sqrt(np.bincount(columns.indices, columns.data**2, columns.shape[1]))


def unsymmetric_at(
    decomposition: Decomposition, stiffness: sp.csr_matrix, nodes: np.ndarray
) -> UnevenStiffness:
    """Return the unsymmetric part of a torn stiffness on the free dofs of some nodes. Collective.

    Args:
        decomposition: The subdomains.
        stiffness: This rank's, torn, shape (torn_size, torn_size), [force / length].
        nodes: Marks of the nodes, shape (n_nodes,).
    """
    tearing, dim = decomposition.tearing, decomposition.tearing.dim
    here, block = decomposition.held
    node = np.empty(len(here), dtype=np.int64)
    node[block] = tearing.copy_node[here]
    dof = (dim * node[:, None] + np.arange(dim)).ravel()
    skew = sp.coo_matrix((stiffness - stiffness.T) / 2)
    row, column = dof[skew.row], dof[skew.col]
    free = (~decomposition.fixed).ravel()
    kept = nodes[row // dim] & free[row] & free[column]
    mine = (row[kept], column[kept], skew.data[kept], float(np.abs(stiffness.data).max(initial=0.0)))
    parts = decomposition.comm.allgather(mine)
    rows, columns, values = (np.concatenate([part[place] for part in parts]) for place in range(3))
    matrix = sp.csr_matrix((values, (rows, columns)), shape=(len(free),) * 2)
    # Between neighbours it cancels but for rounding.
    matrix.data[np.abs(matrix.data) <= ROUNDING * max(part[3] for part in parts)] = 0.0
    matrix.eliminate_zeros()
    felt = np.flatnonzero(np.diff(matrix.indptr))
    left = sp.csr_matrix((np.ones(len(felt)), (felt, np.arange(len(felt)))), shape=(len(free), len(felt)))
    return UnevenStiffness(left, matrix[felt].T.tocsr(), felt // dim)


@displayed
@dataclass(frozen=True, eq=False)
class FurtherRows:
    """The rows of turning forces, after all others.

    Attributes:
        compliance: Of rows of normal forces, of either sign, zero of others, owned, shape (count,).
        acting: Positions among all owned rows of those on which friction acts, shape (k,).
        felt: Positions of those whose displacement changes it, shape (k,).
        share: Displacement in each of these for a force of one, shape (k,).
        lacking: Positions of rows that others lack to be derivatives of gap and slip, shape (m,).
        completed: Positions of these others, shape (m,).
    """

    compliance: Vector
    acting: np.ndarray
    felt: np.ndarray
    share: Vector
    lacking: np.ndarray
    completed: np.ndarray

    @classmethod
    def of(cls, torn: TornSystem, before: TornSystem, turning: TurningForces) -> FurtherRows:
        """Return those of a system, given the one before without them."""
        begin, normal = len(before.numbering.owned), len(turning.compliance)
        number = torn.numbering.owned[begin:] - before.numbering.total
        pairs = len(turning.stiffness)
        compliance = np.concatenate([turning.compliance, np.zeros(turning.count - normal)])
        place, ends = begin + np.arange(len(number)), normal + pairs * np.arange(3)
        acting, felt = ((number >= first) & (number < last) for first, last in pairwise(ends))
        share = 1.0 / turning.stiffness[number[acting] - normal]
        lacking = number >= ends[-1]
        row = before.n_equality + turning.completed[number[lacking] - ends[-1]]
        completed = np.searchsorted(before.numbering.owned, row)
        return cls(compliance[number], place[acting], place[felt], share, place[lacking], completed)

    @property
    def count(self) -> int:
        """Number of rows of this rank."""
        return len(self.compliance)


NO_ROWS = FurtherRows(np.zeros(0), _NONE, _NONE, np.zeros(0), _NONE, _NONE)


def stiffened(
    torn: TornSystem, tangents: list[sp.csr_matrix], geometric: GeometricStiffness
) -> list[sp.csr_matrix]:
    """Add blocks on single nodes, shared by their copies, to the tangents of this rank's subdomains."""
    if len(geometric.block_node) == 0:
        return tangents
    decomposition, dim = torn.decomposition, torn.dim
    entry, copy, place = decomposition.copies_here(geometric.block_node)
    block = geometric.blocks[entry] * decomposition.tearing.copy_share[copy, None, None]
    dofs = dim * place[:, None] + np.arange(dim)
    row, column = np.repeat(dofs, dim, axis=1).ravel(), np.tile(dofs, dim).ravel()
    size = decomposition.torn_size
    added = sp.csr_matrix((block.ravel(), (row, column)), shape=(size, size))
    return with_added(decomposition, tangents, added)


def with_added(
    decomposition: Decomposition, tangents: Sequence[sp.csr_matrix], added: sp.csr_matrix
) -> list[sp.csr_matrix]:
    """Return the tangents of this rank's subdomains with the blocks of a torn matrix added to them."""
    each = zip(tangents, decomposition.parts, strict=True)
    return [(K + added[part, part]).tocsr() for K, part in each]
