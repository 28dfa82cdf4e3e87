"""Where bodies meet: at the points of the undeformed bodies, or wherever they have moved to."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, replace
from functools import cached_property
from typing import TYPE_CHECKING, Protocol

import numpy as np
import scipy.sparse as sp

from fenics_contact.display import displayed
from fenics_contact.errors import together
from fenics_contact.feti import Decomposition, TornSystem, meeting_at, nodal_mean_at, on_copies
from fenics_contact.linalg import scaled_rows
from fenics_contact.nonlinear.loading import Loading
from fenics_contact.nonlinear.turning import RowCorrections, TurningForces, UnevenStiffness
from fenics_contact.pairing import sliding_contact
from fenics_contact.qp import Vector
from fenics_contact.scene import MovingObstacle, RigidObstacle, RigidPlane, Scene, Surface
from fenics_contact.surfaces import share_areas

if TYPE_CHECKING:
    from fenics_contact.pairing import MaterialPoints, SlidingPoints


#: Number of facets that supports and obstacles may pass within a step: contact is searched where nodes stand.
FACETS = 2.0


@displayed
@dataclass(frozen=True, eq=False)
class ContactConfiguration:
    """The contact points at a displacement.

    Attributes:
        torn: The system with the rows of these points.
        points: The points of bodies that have moved; None where those of the undeformed bodies are used.
        start: The points at the start of the load step, in material coordinates of the master; None likewise.
        prescribed: Prescribed components of all nodes, NaN where free, shape (n_nodes, dim), [length].
    """

    torn: TornSystem
    points: SlidingPoints | None
    start: MaterialPoints | None
    prescribed: np.ndarray

    @property
    def material_points(self) -> MaterialPoints | None:
        """The points in material coordinates of the master; None for those of the undeformed bodies."""
        return None if self.points is None else self.points.material_points()

    def from_here(self) -> ContactConfiguration:
        """Return the same points with slip that begins here."""
        return replace(self, start=self.material_points)

    def constraint_residual(self, displacement: Vector) -> Vector:
        """Return c − B u of contact, friction and gluing rows, owned, [length]. Collective.

        Gaps, minus the slip, and openings of glued rows.
        """
        residual = self.torn.right - self.torn.jump(displacement)
        if self.points is None or self.start is None:
            return residual
        return self._with_contact_rows(residual, self.points.points.gap, -self.slip(self.start))

    def slip(self, start: MaterialPoints) -> np.ndarray:
        """Return the slip since other material points, none across planes of symmetry, shape (n, dim − 1)."""
        assert self.points is not None
        return np.where(self._across, 0.0, self.points.slip(start))

    @cached_property
    def _across(self) -> np.ndarray:
        """Marks tangents across planes of symmetry, which supports hold, shape (n, dim − 1).

        Means over the master that change along it would slip, and friction act on nothing but supports.
        """
        torn, points = self.torn, self.torn.points
        across = np.einsum("nad,nd->na", points.tangents**2, points.symmetric) > 0.5
        held = np.zeros_like(across)
        held[torn.frictional] = torn.relations[2].held(torn.decomposition.fixed).reshape(-1, torn.dim - 1)
        return np.asarray(across & held)

    def turning(self, multiplier: Vector, pressure: UnevenStiffness | None) -> TurningForces | None:
        """Return the stiffness of forces that turn with their surfaces; None without any. Collective.

        Args:
            multiplier: λ, owned.
            pressure: The unsymmetric stiffness of pressures.
        """
        further = [] if pressure is None else [pressure]
        if self.points is None or self.start is None:
            return TurningForces.of(None, further) if further else None
        normal, friction = self.at_points(multiplier)
        points, slave, normal = self.points, self.points.points.slave, np.maximum(normal, 0.0)
        stiffness, means = points.stiffness(normal), points.mean_tangents(normal, friction, self.start)
        further += [
            UnevenStiffness(each.left, each.right, slave[each.point])
            for each in (points.friction_stiffness(friction), means.stiffness)
        ]
        width, frictional = self.torn.dim - 1, self.torn.frictional
        rubbed = (width * frictional[:, None] + np.arange(width)).ravel()
        # In the order of the rows of contact, of which those of gaps measure −n·[u].
        slips = scaled_rows(means.slip, 1.0 - self._across.ravel())
        rows = sp.vstack([-means.gap, slips[rubbed]], "csr")
        point = np.concatenate([np.arange(len(slave)), rubbed // width])
        corrections = RowCorrections.of(rows, slave[point])
        return TurningForces.of(stiffness, further, slave[stiffness.point], corrections)

    def carried(self, values: Vector, other: ContactConfiguration, spread: bool = False) -> Vector:
        """Return a vector on the rows of other points on the rows of these. Collective.

        Args:
            values: By row, owned there.
            other: The other points.
            spread: Whether points that are new get the mean of the others, rather than zero.
        """
        if self.points is None or other.points is None:
            return values
        torn, before = self.torn, other.torn
        normal, friction = other.at_points(values)
        if spread:
            normal, friction = (self._filled(x, other) for x in (normal, friction))
        else:
            normal = self.points.carry(normal, other.points)
            friction = self.points.carry_tangential(friction, other.points)
            friction[self._across] = 0.0
        result = np.empty(len(torn.numbering.owned))
        equality = torn.numbering.owned < torn.n_equality
        result[equality] = values[before.numbering.owned < before.n_equality]
        return self._with_contact_rows(result, normal, friction)

    def at_points(self, values: Vector) -> tuple[np.ndarray, np.ndarray]:
        """Return the part of a vector on normal rows, shape (n,), and on tangents, (n, dim − 1). Collective.

        That of points without friction is zero.
        """
        torn = self.torn
        count, width = torn.points.count, torn.dim - 1
        rows = np.concatenate([torn.normal_rows, torn.tangential_rows.ravel()])
        gathered = torn.numbering.gather(values, rows)
        tangential = np.zeros((count, width))
        tangential[torn.frictional] = gathered[count:].reshape(-1, width)
        return gathered[:count], tangential

    def _with_contact_rows(self, values: Vector, normal: np.ndarray, tangential: np.ndarray) -> Vector:
        """Write values at points into the contact rows of a vector, and return it."""
        torn = self.torn
        contact = np.concatenate([normal, tangential[torn.frictional].ravel()])
        mine = torn.numbering.owned >= torn.n_equality
        values[mine] = contact[torn.numbering.owned[mine] - torn.n_equality]
        return values

    def _filled(self, values: np.ndarray, other: ContactConfiguration) -> np.ndarray:
        assert self.points is not None
        assert other.points is not None
        carried = self.points.carry(values, other.points)
        usual = values[values > 0.0].mean() if np.any(values > 0.0) else 1.0
        return np.where(carried > 0.0, carried, usual)

    def with_rows_of(self, turning: TurningForces) -> TornSystem:
        """Return the system with the rows of turning forces after all others, in lengths. Collective."""
        decomposition = self.torn.decomposition
        points = self.torn.points if self.points is None else self.points.points
        further = []
        for columns, owner in turning.columns:
            entries = columns.T.tocoo()
            node, component = np.divmod(entries.col, self.torn.dim)
            free = ~decomposition.fixed[node, component]
            further.append(
                on_copies(
                    decomposition.tearing, entries.row[free], node[free], component[free],
                    entries.data[free], owner,
                )
            )  # fmt: skip
        return meeting_at(self.torn, points, self.prescribed, further)


class Contact(Protocol):
    """How bodies meet."""

    def longest_part(self, first: Loading, last: Loading) -> float:
        """Return the part of the way between two loads that one step may take. Collective.

        What moves must be found again.
        """

    def at(
        self, load: Loading, displacement: Vector, last: ContactConfiguration | None
    ) -> ContactConfiguration:
        """Return the contact points at a displacement. Collective.

        Args:
            load: What acts.
            displacement: u of this rank, torn, shape (torn_size,), [length].
            last: The points at a neighbouring displacement, with the start of their slip; None where slip
                starts here.
        """


class StillContact:
    """Contact at the points of the undeformed bodies: small displacements."""

    def longest_part(self, first: Loading, last: Loading) -> float:
        """Return the whole way."""
        return 1.0

    def at(
        self, load: Loading, displacement: Vector, last: ContactConfiguration | None
    ) -> ContactConfiguration:
        """Return the points of the undeformed bodies."""
        return ContactConfiguration(load.torn, None, None, load.prescribed)


class MovingContact:
    """Contact wherever the bodies have moved to."""

    def __init__(self, scene: Scene, decomposition: Decomposition) -> None:
        """Prepare the surfaces of all pairs. Collective."""
        self._sliding = sliding_contact(scene, decomposition.fixed, decomposition.comm)
        self._places = scene.points
        surfaces = [
            side for pair in scene.contacts for side in (pair.slave, pair.master) if isinstance(side, Surface)
        ]
        numbers = [decomposition.tearing.global_nodes(s.body, np.unique(scene.facets(s))) for s in surfaces]
        self._nodes = np.unique(np.concatenate(numbers))
        # No node passes through a half space: it is known everywhere on which side of a plane a node lies.
        searched = [pair for pair in scene.contacts if not isinstance(_shape(pair.master), RigidPlane)]
        sides = [side for pair in searched for side in (pair.slave, pair.master) if isinstance(side, Surface)]
        self._obstacles = [pair.master for pair in searched if isinstance(pair.master, MovingObstacle)]
        self._facet = min((_facet_size(scene, side) for side in sides), default=np.inf)

    def longest_part(self, first: Loading, last: Loading) -> float:
        """Return the part in which what nodes may pass moves by a few facets. Collective."""
        if np.isinf(self._facet):
            return 1.0
        way = np.nan_to_num(last.prescribed - first.prescribed)
        moved = float(np.linalg.norm(way, axis=1).max(initial=0.0))
        corners = np.array([self._places[self._nodes].min(axis=0), self._places[self._nodes].max(axis=0)])
        with together(last.torn.numbering.comm):
            times = first.time, last.time
            paths = [[obstacle.frame(time) for time in times] for obstacle in self._obstacles]
        for path in paths:
            before, after = (corners @ rotation.T + translation for rotation, translation in path)
            moved = max(moved, float(np.linalg.norm(after - before, axis=1).max()))
        return min(1.0, FACETS * self._facet / moved) if moved > 0.0 else 1.0

    def at(
        self, load: Loading, displacement: Vector, last: ContactConfiguration | None
    ) -> ContactConfiguration:
        """Search for the points at a displacement. Collective."""
        known, start = (None, None) if last is None else (last.points, last.start)
        found = self._sliding.at(self._coordinates(load, displacement), known, load.time, start)
        here = found.material_points()
        start = here if start is None else start.extended(here)
        torn = meeting_at(load.torn, found.points, load.prescribed)
        return ContactConfiguration(torn, found, start, load.prescribed)

    def found_again(
        self, load: Loading, displacement: Vector, stored: Mapping[str, np.ndarray]
    ) -> ContactConfiguration:
        """Return the points that were stored by `SlidingPoints.stored`. Collective."""
        coordinates = self._coordinates(load, displacement)
        found, start = self._sliding.found_again(stored, coordinates, load.time)
        torn = meeting_at(load.torn, found.points, load.prescribed)
        return ContactConfiguration(torn, found, start, load.prescribed)

    def _coordinates(self, load: Loading, displacement: Vector) -> np.ndarray:
        """Return where all nodes are that may meet, shape (n_nodes, dim), [length]. Collective."""
        coordinates = self._places.copy()
        coordinates[self._nodes] += nodal_mean_at(load.torn.decomposition, displacement, self._nodes)
        # Prescribed components reach their values within the step: gaps are those after it.
        return np.where(np.isnan(load.prescribed), coordinates, self._places + load.prescribed)


def _shape(master: Surface | RigidObstacle) -> Surface | RigidObstacle:
    """Return the obstacle that moves, where one does, else the master itself."""
    return master.obstacle if isinstance(master, MovingObstacle) else master


def _facet_size(scene: Scene, side: Surface) -> float:
    """Return the usual size of the facets of a surface, [length]."""
    mesh = scene.bodies[side.body].mesh
    area = float(share_areas(mesh, side.name).sum()) / len(mesh.surfaces[side.name])
    return area ** (1.0 / (scene.dim - 1))
