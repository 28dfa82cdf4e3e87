"""Contact points of a scene whose bodies have moved far."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, replace
from functools import partial

import numpy as np
import scipy.sparse as sp

from fenics_contact._base.libraries import MPI
from fenics_contact._pairing.inside import InFacets, InsideOf
from fenics_contact._pairing.masters import Placements, master_of
from fenics_contact._pairing.points import (
    ContactPoints,
    NodeNumbers,
    in_free_frames,
    join_points,
    tangent_frames,
    tied_keys,
)
from fenics_contact._pairing.search import find_contact_points, find_tied_points
from fenics_contact._pairing.sliding.meeting import (
    Candidates,
    Found,
    Known,
    Moved,
    SlidingPair,
    joined_once,
    require_inside,
    shared_once,
)
from fenics_contact._pairing.sliding.obstacles import OnObstacle
from fenics_contact._pairing.sliding.points import SlidingPoints, with_given_offsets
from fenics_contact._pairing.sliding.slip import LastPoints, MaterialPoints
from fenics_contact._pairing.sliding.stiffness import join_differentials
from fenics_contact._pairing.sliding.surfaces import OnMeans, OnOwnBody, OnPatches
from fenics_contact._pairing.sliding.tools import OnTool
from fenics_contact._pairing.tips import carrying
from fenics_contact._scene.local_axes import NO_AXES, LocalAxes
from fenics_contact._scene.parts import may_touch, slave_of, surface_of
from fenics_contact._scene.scene import Scene
from fenics_contact.errors import InvalidInputError, together

#: Kinds of counterparts of nodes that move far, the first that serves a pair has it.
KINDS: tuple[type[SlidingPair], ...] = (OnOwnBody, OnMeans, OnPatches, OnTool, OnObstacle)


@dataclass(frozen=True)
class SlidingContact:
    """The contact pairs of a scene, whose points are found wherever the bodies lie.

    By nodes the gap is the distance to the closest point of a smooth surface through the master's nodes, see
    `SmoothPatches`; by mortar a mean over the facets as they lie now, see `MovingMeans`; to rigid obstacles
    it is theirs. Nodes may slide over any number of facets, leave the master and come back. By nodes, facets
    are searched anew only for nodes that leave theirs.

    Attributes:
        fixed: Whether a component of a node is prescribed, shape (n_nodes, dim), along its `axes`.
        comm: Communicator of the ranks; all have all points.
        reach: Distance beyond which nodes have no point, [length].
        meetings: What of each pair stays the same.
        axes: Axes of nodes that supports hold along other directions than the coordinates'.

    Example:
        >>> from fenics_contact.gallery import block
        >>> from fenics_contact import Body, ContactPair, RigidPlane, Surface
        >>> from fenics_contact.materials import IsotropicElasticity
        >>> body = Body(block((0, 0, 0), (2, 2, 1), (4, 4, 2)), IsotropicElasticity(10.0, 0.3))
        >>> pair = ContactPair(Surface("block", "z0"), RigidPlane((0, 0, -1), (0, 0, 1)))
        >>> scene = Scene({"block": body}, contacts=[pair])
        >>> sliding = SlidingContact.of(scene, np.zeros(scene.points.shape, dtype=bool))
        >>> now = sliding.at(scene.points)
        >>> then = sliding.at(scene.points + [0.0, 3.0, -0.5], last=now)
        >>> float(then.points.gap[0]), np.abs(then.slip(now.material_points())[0]).round(12).tolist()
        (0.5, [0.0, 3.0])
    """

    scene: Scene
    fixed: np.ndarray
    comm: MPI.Comm
    reach: float
    meetings: tuple[SlidingPair, ...]
    axes: LocalAxes = NO_AXES

    @classmethod
    def of(
        cls,
        scene: Scene,
        fixed: np.ndarray,
        comm: MPI.Comm | None = None,
        *,
        reach: float = np.inf,
        axes: LocalAxes = NO_AXES,
    ) -> SlidingContact:
        """Prepare the pairs of a scene. Collective on ``comm``.

        `fixed`: whether a component of a node is prescribed, shape (n_nodes, dim), along its `axes`; `comm`:
        communicator of the ranks that share the work; this rank alone by default; `reach`: distance beyond
        which nodes need no point, [length].
        """
        comm = comm or MPI.COMM_SELF
        meetings = shared_once(meetings_of(scene, fixed, comm, axes), scene)
        if any(pair.given_gap for pair in scene.contacts):
            origin = scene.origin
            first = meetings
            if origin is not scene:
                first = shared_once(meetings_of(origin, fixed, comm, axes), origin)
            stood = cls(origin, fixed, comm, np.inf, first).at(origin.points)
            meetings = with_given_offsets(meetings, origin, stood.points, fixed, comm)
        return cls(scene, fixed, comm, reach, meetings, axes)

    def with_inside(self, places: InFacets) -> SlidingContact:
        """Return the pairs with points inside facets of slaves on obstacles, by `SlidingPoints.key`."""
        number, node = np.divmod(places.point, len(self.scene.points))
        meetings = list(self.meetings)
        for index in np.unique(number):
            mine = number == index
            inside = InsideOf.of(self.scene, self.scene.contacts[int(index)])
            meetings[index] = meetings[index].with_inside(inside, replace(places, point=node).part(mine))
        return replace(self, meetings=tuple(meetings))

    def at(
        self,
        coordinates: np.ndarray,
        last: SlidingPoints | LastPoints | None = None,
        time: float = 0.0,
        start: MaterialPoints | None = None,
        free_tools: frozenset[str] = frozenset(),
    ) -> SlidingPoints:
        """Return the contact points of the bodies where they lie now. Collective.

        `coordinates`: present coordinates of the nodes of all bodies, shape (n_nodes, dim), [length];
        `free_tools`: names of tools with free components, whose points need derivatives by their motion.
        """
        coordinates = np.asarray(coordinates, dtype=np.float64)
        needed = self.scene.points.shape
        with together(self.comm):
            if coordinates.shape != needed or not np.isfinite(coordinates).all():
                given = f"shape {coordinates.shape}" if coordinates.shape != needed else "NaN or infinity"
                raise InvalidInputError(
                    f"coordinates must be finite numbers of shape {needed}, one row for each node of all "
                    f"bodies, got {given}: add the displacements to scene.points"
                )
            placements: Placements = {}
            for each in self.meetings:
                placements = {**placements, **each.master.placements(each.number, coordinates, time)}
        known = (last or LastPoints.none(needed[1])).points
        before = start or MaterialPoints.none(*needed)
        moved = Moved(self.scene, coordinates, placements, known, before, free_tools, self.reach, self.comm)
        parts = [self._found(each, moved) for each in self.meetings]
        points = join_points([part.points for part in parts], self.scene.dim, len(coordinates))
        differential = join_differentials(
            [part.differential for part in parts], self.scene.dim, len(coordinates)
        )
        lost = np.concatenate([np.zeros(0, dtype=np.int64), *[part.lost for part in parts]])
        means = {number: each for part in parts for number, each in part.means.items()}
        return SlidingPoints(points, coordinates, means, placements, differential, lost)

    def found_again(
        self,
        stored: Mapping[str, np.ndarray],
        coordinates: np.ndarray,
        time: float,
        free_tools: frozenset[str] = frozenset(),
    ) -> tuple[SlidingPoints, MaterialPoints]:
        """Return points that were stored, and where they stood. Collective.

        `coordinates`: the coordinates of then, shape (n_nodes, dim), [length]; `free_tools` as in `at`.
        """
        found = self.at(coordinates, LastPoints.of(stored), time, free_tools=free_tools)
        return found, MaterialPoints.of(stored, len(coordinates))

    def _found(self, meeting: SlidingPair, moved: Moved) -> Found:
        """Return the points of one pair. Collective."""
        found = meeting.at(moved)
        axes = _kept_axes(found.points, moved.last, meeting.number)
        points = replace(found.points, axes=axes, tangents=tangent_frames(found.points.normal, axes))
        return replace(found, points=in_free_frames(points, self.fixed, self.axes))


def _kept_axes(points: ContactPoints, last: Known, index: int, steepest: float = 0.9) -> np.ndarray:
    """Return the axes nearest to the first tangents: the last ones, unless they come near the normal."""
    axes, before = points.axes.copy(), np.flatnonzero(last.pair == index)
    _, now, then = np.intersect1d(points.slave, last.slave[before], return_indices=True)
    old = last.axes[before[then]]
    stays = np.abs(np.einsum("nd,nd->n", old, points.normal[now])) < steepest
    axes[now[stays]] = old[stays]
    return axes


def meetings_of(
    scene: Scene, fixed: np.ndarray, comm: MPI.Comm, axes: LocalAxes = NO_AXES
) -> tuple[SlidingPair, ...]:
    """Return the pairs of a scene in its reference configuration. Collective.

    `fixed`: whether a component of a node is prescribed, shape (n_nodes, dim), along its `axes`.
    """
    with together(comm):
        require_inside(scene)
    points = ties = join_points([], scene.dim, len(fixed))
    if scene.contacts and scene.ties:
        points, ties = (find(scene, fixed, comm) for find in (find_contact_points, find_tied_points))
    number, slave = tied_keys(points, ties, scene, fixed, axes)
    with together(comm):
        meetings = tuple(
            _meeting(scene, index, fixed, slave[number == index]) for index in range(len(scene.contacts))
        )
        return joined_once(meetings, scene, points, ties)


def _meeting(scene: Scene, number: int, fixed: np.ndarray, tied: np.ndarray) -> SlidingPair:
    """Return a pair; `tied`: nodes that have no points, as ties hold them."""
    pair, dim = scene.contacts[number], scene.dim
    kind = next(each for each in KINDS if each.serves(pair))
    slave = slave_of(scene, pair, "faceted")
    slave_nodes = NodeNumbers.of(scene).global_nodes(pair.slave.body, slave.nodes)
    bearing = ~fixed[slave_nodes].all(axis=1) & ~np.isin(slave_nodes, tied)
    bearing &= may_touch(scene.bodies, pair, slave)
    master = master_of(scene, pair, partial(surface_of, scene, geometry="faceted"))
    candidates = np.flatnonzero(bearing & carrying(pair, slave, master))
    count = len(candidates)
    at_nodes = np.ones(count), candidates, np.arange(count + 1)
    side = Candidates(
        number, slave, slave_nodes, candidates, np.zeros(count), np.zeros(count, dtype=bool),
        slave.point_areas[candidates], sp.csr_matrix(at_nodes, shape=(count, len(slave.nodes))),
        np.full(count, -1), np.zeros((count, dim - 1)),
        sp.csr_matrix((count, len(scene.contacts)), dtype=np.int64),
    )  # fmt: skip
    return kind.of(scene, pair, side, master)
