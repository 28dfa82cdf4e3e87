"""Forces that turn with their surfaces: how they change as these do."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
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
class RowCorrections:
    """The differences of derivatives of gap and slip from the rows of their forces.

    Attributes:
        columns: Of each row that is not the derivative, shape (n_dofs, m); dof dim · node + component of all
            nodes.
        corrected: Number of that row among those of contact, shape (m,).
        owner: Node whose rank owns both, shape (m,).
    """

    columns: sp.csr_matrix
    corrected: np.ndarray
    owner: np.ndarray

    @classmethod
    def of(cls, rows: sp.csr_matrix, owner: np.ndarray) -> RowCorrections:
        """Return those that are not zero, of all rows of contact, shape (n, n_dofs), with their owners."""
        corrected = np.flatnonzero(_lengths(rows.T.tocsr()) > ROUNDING)
        return cls(rows[corrected].T.tocsr(), corrected, owner[corrected])


@displayed
@dataclass(frozen=True, eq=False)
class TurningForces:
    """How forces change as surfaces turn under them, at fixed multipliers, and gaps other than by their rows.

    Attributes:
        normal: Of the normal forces of contact, symmetric; None where contact points do not move.
        normal_owner: Node whose rank owns the row of each of its columns.
        forces: Directions of changes of friction forces and pressures, columns of length one, shape (n_dofs,
            k).
        displacements: The displacements that change them, columns of length one, shape (n_dofs, k).
        stiffness: Change of force for a displacement of one, shape (k,), [force / length].
        owner: Node whose rank owns the rows of each of these, shape (k,).
        corrections: Those of rows of contact; None where contact points do not move.
    """

    normal: GeometricStiffness | None
    normal_owner: np.ndarray
    forces: sp.csr_matrix
    displacements: sp.csr_matrix
    stiffness: np.ndarray
    owner: np.ndarray
    corrections: RowCorrections | None

    @classmethod
    def of(
        cls,
        normal: GeometricStiffness | None,
        others: Sequence[UnevenStiffness],
        normal_owner: np.ndarray = _NONE,
        corrections: RowCorrections | None = None,
    ) -> TurningForces:
        """Return those of several stiffnesses, with at least one unsymmetric one."""
        others = [each for each in others if each.left.shape[1]] or others[:1]
        L, R = (_joined([getattr(each, side) for each in others]) for side in ("left", "right"))
        owner = np.concatenate([each.owner for each in others])
        left, right = _lengths(L), _lengths(R)
        kept = np.flatnonzero(left * right > ROUNDING * (left * right).max(initial=0.0))
        forces, displacements = (
            scaled_columns(columns[:, kept], 1.0 / lengths[kept])
            for columns, lengths in ((L, left), (R, right))
        )
        stiffness = (left * right)[kept]
        return cls(normal, normal_owner, forces, displacements, stiffness, owner[kept], corrections)

    @property
    def compliance(self) -> np.ndarray:
        """Of the rows of normal forces, of either sign, shape (m,), [length / force]."""
        return np.zeros(0) if self.normal is None else 1.0 / self.normal.values

    @property
    def columns(self) -> list[tuple[sp.csr_matrix, np.ndarray]]:
        """Columns of all rows with the nodes whose ranks own them, in the order of `FurtherRows`."""
        parts = [] if self.normal is None else [(self.normal.columns, self.normal_owner)]
        parts += [(self.forces, self.owner), (self.displacements, self.owner)]
        if self.corrections is not None:
            parts.append((self.corrections.columns, self.corrections.owner))
        return parts

    @property
    def count(self) -> int:
        """Number of rows."""
        return sum(len(owner) for _, owner in self.columns)

    @property
    def corrected(self) -> np.ndarray:
        """Numbers of rows of contact that are corrected, shape (m,)."""
        return _NONE if self.corrections is None else self.corrections.corrected


def _joined(parts: Sequence[sp.csr_matrix]) -> sp.csr_matrix:
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
    changed = np.flatnonzero(np.diff(matrix.indptr))
    entries = np.ones(len(changed)), (changed, np.arange(len(changed)))
    left = sp.csr_matrix(entries, shape=(len(free), len(changed)))
    return UnevenStiffness(left, matrix[changed].T.tocsr(), changed // dim)


@displayed
@dataclass(frozen=True, eq=False)
class FurtherRows:
    """The rows of turning forces, after all others; positions are among all owned rows.

    Attributes:
        compliance: Of rows of normal forces, of either sign, zero of others, owned, shape (count,).
        force_rows: Positions of rows whose multipliers act without being measured: each is what the row of
            `displacement_rows` of the same number measures, an unsymmetric stiffness; shape (k,).
        displacement_rows: Positions of these rows, which have no multipliers, shape (k,).
        share: What each of them measures for a multiplier of one, shape (k,).
        correction_rows: Positions of rows without multipliers that others need where displacements are
            measured: the derivative of a gap need not be the row of its force; shape (m,).
        corrected_rows: Positions of these others, shape (m,).
        correction: The factor with which the former are added to the latter, shape (m,).
    """

    compliance: Vector
    force_rows: np.ndarray
    displacement_rows: np.ndarray
    share: Vector
    correction_rows: np.ndarray
    corrected_rows: np.ndarray
    correction: Vector

    @classmethod
    def of(cls, torn: TornSystem, before: TornSystem, turning: TurningForces) -> FurtherRows:
        """Return those of a system, given the one before without them."""
        begin, normal = len(before.numbering.owned), len(turning.compliance)
        number = torn.numbering.owned[begin:] - before.numbering.total
        pairs = len(turning.stiffness)
        compliance = np.concatenate([turning.compliance, np.zeros(turning.count - normal)])
        place, ends = begin + np.arange(len(number)), normal + pairs * np.arange(3)
        forces, displacements = ((number >= first) & (number < last) for first, last in pairwise(ends))
        correcting = number >= ends[-1]
        row = before.n_equality + turning.corrected[number[correcting] - ends[-1]]
        return cls(
            compliance[number],
            place[forces],
            place[displacements],
            1.0 / turning.stiffness[number[forces] - normal],
            place[correcting],
            np.searchsorted(before.numbering.owned, row),
            np.ones(np.count_nonzero(correcting)),
        )

    @property
    def count(self) -> int:
        """Number of rows of this rank."""
        return len(self.compliance)

    def scaled(self, s: Vector) -> FurtherRows:
        """Return the rows for multipliers λ / s, with s of all owned rows."""
        return replace(
            self,
            compliance=np.asarray(self.compliance * s[len(s) - self.count :] ** 2),
            share=np.asarray(self.share * s[self.displacement_rows] * s[self.force_rows]),
            correction=np.asarray(self.correction * s[self.corrected_rows] / s[self.correction_rows]),
        )


NO_ROWS = FurtherRows(np.zeros(0), _NONE, _NONE, np.zeros(0), _NONE, _NONE, np.zeros(0))


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
