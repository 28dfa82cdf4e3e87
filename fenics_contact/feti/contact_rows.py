"""Rows of B at contact points: gap along the normal, and slip along the tangents."""

from __future__ import annotations

from dataclasses import dataclass, field, replace
from typing import TYPE_CHECKING

import numpy as np
import scipy.sparse as sp

from fenics_contact._base.libraries import MPI
from fenics_contact._base.sparse import LAST_PLACES
from fenics_contact._pairing.points import (
    HELD,
    ContactPoints,
    FreeSpaces,
    closures_of,
    elastic_slip,
    friction_data,
    reach_of,
)
from fenics_contact._scene.local_axes import NO_AXES, LocalAxes, free_part
from fenics_contact._scene.scene import Scene
from fenics_contact.feti.decomposition import Rows, Tearing
from fenics_contact.feti.initial_gaps import gap_with_room
from fenics_contact.feti.row_groups import RowGroup, columns_of
from fenics_contact.qp.cones import Proportional

if TYPE_CHECKING:
    from fenics_contact.qp.compliance import Closures


@dataclass(frozen=True, eq=False)
class Relations(RowGroup):
    """The relative displacement that each row measures: d·(u_slave − Σ w_j u_master,j)."""

    points: ContactPoints
    which: np.ndarray
    directions: np.ndarray
    axes: LocalAxes = field(default=NO_AXES, kw_only=True)

    @property
    def count(self) -> int:
        """Number of rows."""
        return len(self.which)

    @property
    def components(self) -> int:
        """Displacement components of a node."""
        return int(self.directions.shape[1])

    def measured(self, field: np.ndarray) -> np.ndarray:
        """Return what a displacement of all nodes along the coordinates is in the rows, shape (n_rows,)."""
        return np.einsum("rd,rd->r", self.directions, self.points.relative(field)[self.which])

    def of_supports(self, prescribed: np.ndarray) -> np.ndarray:
        """Return the contribution of prescribed displacements to each row, shape (n_rows,), [length]."""
        known = np.nan_to_num(prescribed)
        along = self.measured(self.axes.to_global(known))
        # What is left of motions that cancel is none: slip along it would have friction.
        least = LAST_PLACES * np.abs(known).max(initial=0.0)
        return np.where(np.abs(along) <= least, 0.0, along)

    def columns(self, fields: sp.csr_matrix) -> sp.csr_matrix:
        """Return by how much fields of nodes, (n_nodes · dim, n), close the rows, shape (n_rows, n)."""
        return columns_of(self, fields, self.components)

    def held(self, fixed: np.ndarray) -> np.ndarray:
        """Return which rows supports determine, shape (n_rows,)."""
        left = FreeSpaces.of(self.points, fixed, self.axes).part(self.directions, self.which)
        return np.asarray(np.einsum("rd,rd->r", left, left) <= HELD**2)

    def rows(self, tearing: Tearing, fixed: np.ndarray) -> Rows:
        """Return the part of these rows of B that acts on free components, with an empty right side.

        The displacement of a node is the mean of its copies, weighted as the gluing rows are: that makes
        these rows orthogonal to them. Prescribed components are known: kept, they would couple these rows to
        those of the supports, and make them redundant where supports hold both surfaces.
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

    `slaves`: for each row a node whose rank owns it.
    """
    entry, copy = tearing.copies_of(node)
    owner = tearing.subdomain_rank[tearing.copy_subdomain[tearing.first_copy[slaves]]]
    value = value[entry] * tearing.copy_share[copy]
    return Rows(row[entry], copy, component[entry], value, np.zeros(len(slaves)), owner)


@dataclass(frozen=True, eq=False)
class NormalRows(Relations):
    """Rows −n·(u_slave − u_master) ≤ gap, one for each contact point.

    `closures`: closures of the contact points under their forces, replicated; None where contact is exact.
    """

    closures: Closures | None = field(default=None, kw_only=True)

    @classmethod
    def of(cls, scene: Scene, points: ContactPoints, axes: LocalAxes = NO_AXES) -> NormalRows:
        """Return those of the contact points of a scene."""
        every = np.arange(points.count)
        return cls(points, every, -points.normal, axes=axes, closures=closures_of(scene, points))

    def right(self, scene: Scene, prescribed: np.ndarray) -> np.ndarray:
        """Return the gaps at which pressure begins, shape (n_points,), [length]."""
        return np.asarray(self.gap(prescribed) - self.reach(scene))

    def gap(self, prescribed: np.ndarray) -> np.ndarray:
        """Return the gaps, with room between surfaces that supports hold, shape (n_points,), [length]."""
        freedom, moved = self.freedom(~np.isnan(prescribed)), self.of_supports(prescribed)
        return gap_with_room(self.points, freedom, moved, self.soft)

    def reach(self, scene: Scene) -> np.ndarray | float:
        """Return the distances at which pressure begins, shape (n_points,); zero where contact is exact."""
        return 0.0 if self.closures is None else reach_of(scene, self.points)

    @property
    def soft(self) -> np.ndarray:
        """Marks of points that give way, shape (n_points,)."""
        return np.zeros(self.count, dtype=bool) if self.closures is None else self.closures.soft

    def freedom(self, fixed: np.ndarray) -> np.ndarray:
        """Return the length of the free part of each direction, from 0 to 1, shape (n_rows,)."""
        free = FreeSpaces.of(self.points, fixed, self.axes)
        return np.asarray(np.linalg.norm(free.part(self.directions, self.which), axis=1))


@dataclass(frozen=True, eq=False)
class TangentialRows(Relations):
    """The slip t_a·(u_slave − u_master): dim − 1 consecutive rows for each frictional point.

    `resting`: marks of rows along which supports prescribe no slip; `elastic_slip`: slip of sticking points
    per friction force, replicated; `strength`: the part of slip bounds that follows λ_N, replicated.
    """

    from_before = True

    resting: np.ndarray
    frictional: np.ndarray
    tresca_bound: np.ndarray
    elastic_slip: np.ndarray
    strength: Proportional

    @property
    def coefficient(self) -> np.ndarray:
        """μ of the frictional points, or the largest ratio of friction to normal force, (n_friction,)."""
        return self.strength.coefficient

    def held(self, fixed: np.ndarray, parallel: float = 1e-6) -> np.ndarray:
        """Return which rows supports determine, alone or with the normal row, shape (n_rows,).

        With rollers on both sides, the free part of a tangent is parallel to that of the normal: along it a
        closed point cannot slip, and an open one opens. Such a row is left to the normal one unless it has
        the larger free part, or supports drive the point along it: then it slips. `parallel`: directions
        count as parallel if their sine is below this.
        """
        free = FreeSpaces.of(self.points, fixed, self.axes)
        left = free.part(self.directions, self.which)
        mine = np.einsum("rd,rd->r", left, left)
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

    @classmethod
    def of(
        cls,
        scene: Scene,
        points: ContactPoints,
        prescribed: np.ndarray,
        comm: MPI.Comm,
        axes: LocalAxes = NO_AXES,
    ) -> TangentialRows:
        """Return those of the contact points of a scene. Collective on ``comm``."""
        has_friction, bound, strength = friction_data(scene, points, comm)
        frictional, dim = np.flatnonzero(has_friction), points.normal.shape[1]
        which, directions = np.repeat(frictional, dim - 1), points.tangents[frictional].reshape(-1, dim)
        driven = Relations(points, which, directions, axes=axes).of_supports(prescribed)
        return cls(
            points, which, directions, driven == 0.0, frictional, bound[frictional],
            elastic_slip(scene, points)[frictional], strength.part(frictional), axes=axes,
        )  # fmt: skip

    @property
    def is_elastic(self) -> bool:
        """Whether some points give way before they slip."""
        return bool(np.any(self.elastic_slip > 0.0))

    @property
    def frictionless(self) -> np.ndarray:
        """Numbers of the contact points without friction, shape (n_contact − n_friction,)."""
        return np.setdiff1d(np.arange(self.points.count), self.frictional, assume_unique=True)

    def driven_as(self, prescribed: np.ndarray) -> bool:
        """Return whether supports drive the same points, see `of`."""
        return np.array_equal(self.of_supports(prescribed) == 0.0, self.resting)

    def slip_bound(self, normal_force: np.ndarray) -> np.ndarray:
        """Return Ψ at normal forces of the frictional points, shape (n_friction,), [force]."""
        return np.asarray(self.tresca_bound + self.strength.bound(normal_force))

    def with_coefficient(self, coefficient: np.ndarray) -> TangentialRows:
        """Return the same rows with other friction coefficients, shape (n_friction,)."""
        return replace(self, strength=replace(self.strength, coefficient=coefficient))
