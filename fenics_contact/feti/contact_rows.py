"""Rows of B at contact points: gap along the normal, slip along the tangents, all components where tied."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np

from fenics_contact._base.sparse import LAST_PLACES
from fenics_contact._pairing.points import HELD, ContactPoints, FreeSpaces, are_sliding
from fenics_contact._scene.local_axes import LocalAxes, free_part
from fenics_contact._scene.sectors import AnyTie
from fenics_contact.feti.decomposition import Rows, Tearing


@dataclass(frozen=True)
class Relations:
    """The relative displacement that each row measures: d·(u_slave − Σ w_j u_master,j).

    Attributes:
        which: Point of each row, shape (n_rows,).
        directions: d of each row, shape (n_rows, dim).
        resting: Marks of friction rows along which supports prescribe no slip, shape (n_rows,); None for
            other rows.
        axes: Axes of nodes along which supports prescribe components; None: the coordinates' everywhere.
        sprung: Number of the last rows, which are those of springs: their forces act also where supports
            determine them.
    """

    points: ContactPoints
    which: np.ndarray
    directions: np.ndarray
    resting: np.ndarray | None = None
    axes: LocalAxes | None = None
    sprung: int = 0

    @property
    def count(self) -> int:
        """Number of rows."""
        return len(self.which)

    @property
    def components(self) -> int:
        """Displacement components of a node."""
        return int(self.directions.shape[1])

    def of_supports(self, prescribed: np.ndarray) -> np.ndarray:
        """Return the contribution of prescribed displacements to each row, shape (n_rows,), [length].

        `prescribed`: prescribed components of all nodes, NaN where free, shape (n_nodes, dim).
        """
        known = np.nan_to_num(prescribed)
        moved = self.points.relative(known if self.axes is None else self.axes.to_global(known))
        along = np.einsum("rd,rd->r", self.directions, moved[self.which])
        # What is left of motions that cancel is none: slip along it would have friction.
        least = LAST_PLACES * np.abs(known).max(initial=0.0)
        return np.where(np.abs(along) <= least, 0.0, along)

    def held(self, fixed: np.ndarray, parallel: float = 1e-6) -> np.ndarray:
        """Return which rows supports determine, alone or with the normal row, shape (n_rows,).

        With rollers on both sides, the free part of a tangent is parallel to that of the normal: along it a
        closed point cannot slip, and an open one opens. Such a row is left to the normal one unless it has
        the larger free part, or supports drive the point along it: then it slips.

        `fixed`: whether a component of a node is prescribed, shape (n_nodes, dim); `parallel`: directions
        count as parallel if their sine is below this.
        """
        free = FreeSpaces.of(self.points, fixed, self.axes)
        left = free.part(self.directions, self.which)
        mine = np.einsum("rd,rd->r", left, left)
        if self.resting is None:
            return np.asarray((mine <= HELD**2) & (np.arange(self.count) < self.count - self.sprung))
        normal = free.part(self.points.normal[self.which], self.which)
        other = np.einsum("rd,rd->r", normal, normal)
        across = mine * other - np.einsum("rd,rd->r", left, normal) ** 2
        tilted = (across <= parallel**2 * mine * other) & (mine < other)
        return np.asarray((mine <= HELD**2) | (self.resting & tilted))

    def along_normals(self, fixed: np.ndarray) -> np.ndarray:
        """Return free parts of directions along those of the normals, relative to these, shape (n_rows,)."""
        free = FreeSpaces.of(self.points, fixed, self.axes)
        left = free.part(self.directions, self.which)
        normal = free.part(self.points.normal[self.which], self.which)
        size = np.einsum("rd,rd->r", normal, normal)
        return np.einsum("rd,rd->r", left, normal) / np.where(size > HELD**2, size, np.inf)

    def freedom(self, fixed: np.ndarray) -> np.ndarray:
        """Return the length of the free part of each direction, from 0 to 1, shape (n_rows,)."""
        free = FreeSpaces.of(self.points, fixed, self.axes)
        return np.asarray(np.linalg.norm(free.part(self.directions, self.which), axis=1))

    def rows(self, tearing: Tearing, fixed: np.ndarray) -> Rows:
        """Return the part of these rows of B that acts on free components, with an empty right side.

        The displacement of a node is the mean of its copies, weighted as the gluing rows are: that makes
        these rows orthogonal to them. Prescribed components are known: kept, they would couple these rows to
        those of the supports, and make them redundant where supports hold both surfaces.

        `fixed`: whether a component of a node is prescribed, shape (n_nodes, dim).
        """
        if self.count == 0:
            none = np.zeros(0, dtype=np.int64)
            return Rows(none, none, none, np.zeros(0), np.zeros(0), none)
        # Sorted by row: every rank builds the same rows, and the owner's copy is that of the slave node.
        row, node, weight, along = self.points.entries(self.which, self.directions)
        value = weight[:, None] * free_part(along, node, fixed, self.axes)
        # Directions along an axis have no entries in other components: the preconditioner depends on the
        # pattern.
        entry, component = np.nonzero(np.where(self.held(fixed)[row][:, None], 0.0, value))
        slaves = self.points.slave[self.which]
        return on_copies(tearing, row[entry], node[entry], component, value[entry, component], slaves)


def on_copies(
    tearing: Tearing,
    row: np.ndarray,
    node: np.ndarray,
    component: np.ndarray,
    value: np.ndarray,
    slaves: np.ndarray,
) -> Rows:
    """Return rows on nodal displacements, the means of copies weighted by stiffness, as rows of B.

    `row`: row of each entry, shape (n_entries,); `node`: its node, shape (n_entries,); `component`: its
    component, shape (n_entries,); `value`: its value, shape (n_entries,); `slaves`: for each row a node whose
    rank owns it, shape (n_rows,).
    """
    entry, copy = tearing.copies_of(node)
    owner = tearing.subdomain_rank[tearing.copy_subdomain[tearing.first_copy[slaves]]]
    value = value[entry] * tearing.copy_share[copy]
    return Rows(row[entry], copy, component[entry], value, np.zeros(len(slaves)), owner)


def normal_relations(points: ContactPoints, axes: LocalAxes | None = None) -> Relations:
    """Return −n·(u_slave − u_master) ≤ gap, one row for each contact point."""
    return Relations(points, np.arange(points.count), -points.normal, axes=axes)


def tangential_relations(
    points: ContactPoints,
    frictional: np.ndarray,
    prescribed: np.ndarray,
    axes: LocalAxes | None = None,
) -> Relations:
    """Return the slip t_a·(u_slave − u_master): dim − 1 consecutive rows for each frictional point.

    `prescribed`: prescribed components of all nodes, NaN where free, shape (n_nodes, dim), along their
    `axes`.
    """
    dim = points.normal.shape[1]
    which, directions = np.repeat(frictional, dim - 1), points.tangents[frictional].reshape(-1, dim)
    rows = Relations(points, which, directions, axes=axes)
    return replace(rows, resting=rows.of_supports(prescribed) == 0.0)


def tied_relations(
    points: ContactPoints, ties: Sequence[AnyTie], fixed: np.ndarray, axes: LocalAxes | None = None
) -> Relations:
    """Return u_slave − u_master = 0 at tied points, only along the normal where the tie may slide.

    A component that a support prescribes on the slave node is left to the support.

    `fixed`: whether a component of a node is prescribed, shape (n_nodes, dim), along its `axes`.
    """
    dim = points.normal.shape[1]
    sliding = are_sliding(ties, points.pair)
    bonded, component = np.nonzero(~sliding[:, None] & ~fixed[points.slave])
    gliding = np.flatnonzero(sliding)
    along = np.eye(dim)[component]
    if axes is not None:
        place = axes.place(points.slave[bonded])
        turned = place >= 0
        along[turned] = axes.axes[place[turned], component[turned]]
    which = np.concatenate([bonded, gliding])
    return Relations(points, which, np.concatenate([along, -points.normal[gliding]]), axes=axes)
