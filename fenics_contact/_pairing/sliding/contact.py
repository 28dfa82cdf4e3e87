"""Contact points of a scene whose bodies have moved far."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, replace
from typing import TypeAlias

import numpy as np
import scipy.sparse as sp

from fenics_contact._base.checks import floats
from fenics_contact._base.fingerprint import described, require_alike
from fenics_contact._base.libraries import MPI
from fenics_contact._base.sparse import ROUNDING
from fenics_contact._pairing.inside import InFacets, InsideOf
from fenics_contact._pairing.points import (
    ContactPoints,
    NodeNumbers,
    in_free_frames,
    join_points,
    reference_axes,
    tangent_frames,
    with_symmetry,
)
from fenics_contact._pairing.sliding.closest import patch_points
from fenics_contact._pairing.sliding.means import MovingMeans
from fenics_contact._pairing.sliding.meeting import Meeting, meetings_of, shared_once
from fenics_contact._pairing.sliding.points import SlidingPoints, with_given_offsets
from fenics_contact._pairing.sliding.slip import LastPoints, MaterialPoints
from fenics_contact._pairing.sliding.stiffness import Differential, join_differentials, without_patches
from fenics_contact._scene.local_axes import NO_AXES, LocalAxes
from fenics_contact._scene.obstacles import MovingObstacle, RigidObstacle, RigidTool
from fenics_contact._scene.scene import Scene
from fenics_contact._scene.tools import ToolBody
from fenics_contact._surfaces.facets import shape_functions
from fenics_contact.errors import InvalidInputError, together
from fenics_contact.shapes.combined import placed
from fenics_contact.shapes.simple import evaluate_shape

Known: TypeAlias = ContactPoints | LastPoints


@dataclass(frozen=True)
class _Found:
    """The points of one pair, what derivatives of them need, and nodes without one."""

    points: ContactPoints
    differential: Differential
    lost: np.ndarray
    means: MovingMeans | None


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
        axes: Axes of nodes that supports hold along other directions than the coordinates'; None: there are
            none.

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
    meetings: tuple[Meeting, ...]
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
        loose: frozenset[str] = frozenset(),
    ) -> SlidingPoints:
        """Return the contact points of the bodies where they lie now. Collective.

        `coordinates`: present coordinates of the nodes of all bodies, shape (n_nodes, dim), [length];
        `loose`: names of tools with free components, whose points need derivatives by their motion.
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
            places = tuple(self._frame(each.obstacle, coordinates, time) for each in self.meetings)
        known = last.points if isinstance(last, SlidingPoints) else last
        parts = [
            self._pair(index, coordinates, known, time, start, loose) for index in range(len(self.meetings))
        ]
        points = join_points([part.points for part in parts], self.scene.dim, len(coordinates))
        differential = join_differentials(
            [part.differential for part in parts], self.scene.dim, len(coordinates)
        )
        lost = np.concatenate([np.zeros(0, dtype=np.int64), *[part.lost for part in parts]])
        means = tuple(part.means for part in parts)
        return SlidingPoints(points, coordinates, means, places, differential, lost)

    def found_again(
        self,
        stored: Mapping[str, np.ndarray],
        coordinates: np.ndarray,
        time: float,
        loose: frozenset[str] = frozenset(),
    ) -> tuple[SlidingPoints, MaterialPoints]:
        """Return points that were stored, and where they stood. Collective.

        `coordinates`: the coordinates of then, shape (n_nodes, dim), [length]; `loose` as in `at`.
        """
        found = self.at(coordinates, LastPoints.of(stored), time, loose=loose)
        return found, MaterialPoints.of(stored, len(coordinates))

    def _pair(
        self,
        index: int,
        coordinates: np.ndarray,
        last: Known | None,
        time: float,
        start: MaterialPoints | None,
        loose: frozenset[str],
    ) -> _Found:
        """Return the points of one pair. Collective."""
        meeting, lost, means = self.meetings[index], np.zeros(0, dtype=np.int64), None
        if meeting.obstacle is not None:
            with together(self.comm):
                points, differential = self._on_obstacle(meeting, coordinates, time)
                if isinstance(meeting.obstacle, RigidTool) and meeting.obstacle.name in loose:
                    points, differential = self._on_tool(points, differential, meeting.obstacle, coordinates)
            name = f"what ContactPair {index} asks its obstacle, {type(meeting.obstacle).__name__}"
            require_alike(self.comm, described((points.slave, points.normal, points.gap), name))
        elif meeting.facets is not None:
            points, differential, means = self._on_means(meeting, coordinates)
        else:
            points, differential, lost = self._on_patches(index, meeting, coordinates, last, start)
        points = replace(points, pair=np.full(points.count, index))
        axes = points.axes if last is None else _kept_axes(points, last, index)
        points = replace(points, axes=axes, tangents=tangent_frames(points.normal, axes))
        return _Found(in_free_frames(points, self.fixed, self.axes), differential, lost, means)

    def _frame(
        self, obstacle: RigidObstacle | None, coordinates: np.ndarray, time: float
    ) -> tuple[np.ndarray, np.ndarray] | None:
        """Return rotation and translation of an obstacle that moves, None of others."""
        if isinstance(obstacle, MovingObstacle):
            return obstacle.frame(time)
        if not isinstance(obstacle, RigidTool):
            return None
        body, numbers = self.scene.bodies[obstacle.name], NodeNumbers.of(self.scene)
        assert isinstance(body, ToolBody)
        return body.frame(coordinates[numbers.global_nodes(obstacle.name, np.arange(body.mesh.n_nodes))])

    def _on_obstacle(
        self, meeting: Meeting, coordinates: np.ndarray, time: float
    ) -> tuple[ContactPoints, Differential]:
        obstacle = meeting.obstacle
        assert obstacle is not None
        frame = self._frame(obstacle, coordinates, time)
        still = obstacle.obstacle if isinstance(obstacle, MovingObstacle) else obstacle
        shape = still if frame is None else placed(still, frame[0], floats(frame[1]))
        place = meeting.own @ coordinates[meeting.slave_nodes]
        gap, normal = evaluate_shape(shape, "distance", place), evaluate_shape(shape, "normals", place)
        facing = np.einsum("nd,nd->n", meeting.normals(coordinates), normal) < 0
        chosen = np.flatnonzero(facing & (gap <= self.reach))
        curvature = evaluate_shape(shape, "curvatures", place[chosen])
        none = sp.csr_matrix((len(chosen), len(coordinates)))
        points = _points(meeting, chosen, normal[chosen], gap[chosen], none)
        points = _where_they_lie(points, meeting, chosen)
        points = with_symmetry(points, meeting.cut[chosen], meeting.slave.planes)
        return points, without_patches(curvature, len(coordinates))

    def _on_tool(
        self, points: ContactPoints, differential: Differential, tool: RigidTool, coordinates: np.ndarray
    ) -> tuple[ContactPoints, Differential]:
        """Return points on a tool like those on a body, of the nodes that carry its motion.

        At the foot Y of a point on the tool these have affine weights w(Y), so that its surface S = Σ w_j x_j
        is one of patches: with orthonormal tangents t_a, S,_a = t_a, W,_a = t_a·∂w/∂Y, and n·S,_ab = −D₀ with
        the curvature D₀ = D (I − r D)⁻¹ of the surface at Y, D being that of the distance r.
        """
        body, frame = self.scene.bodies[tool.name], self._frame(tool, coordinates, 0.0)
        assert isinstance(body, ToolBody)
        assert frame is not None
        turn, shift = frame
        nodes = NodeNumbers.of(self.scene).global_nodes(tool.name, np.arange(body.mesh.n_nodes))
        foot = points.own @ coordinates - points.distance[:, None] * points.normal
        slopes = points.tangents @ turn @ body.cell_slopes.T
        second = np.einsum("nad,nde,nbe->nab", points.tangents, differential.curvature, points.tangents)
        # At edges and corners, where a foot stays, r D has an eigenvalue of one.
        stays = (1.0 + ROUNDING) * np.eye(second.shape[1]) - points.distance[:, None, None] * second
        bend, none = -second @ np.linalg.inv(stays), np.zeros_like(differential.curvature)
        master = _carried(body.weights((foot - shift) @ turn), nodes, len(coordinates))
        of_slopes = (_carried(slopes[:, a], nodes, len(coordinates)) for a in range(slopes.shape[1]))
        points = replace(points, master=master, facet=np.zeros(points.count, dtype=np.int64))
        return points, Differential(points.tangents, bend, tuple(of_slopes), none)

    def _on_means(
        self, meeting: Meeting, coordinates: np.ndarray
    ) -> tuple[ContactPoints, Differential, MovingMeans]:
        means = MovingMeans.of(meeting, coordinates, self.comm)
        met = means.coupling
        chosen = np.searchsorted(meeting.candidates, met.node)
        near = met.gap <= self.reach
        means, chosen = replace(means, coupling=met.part(near)), chosen[near]
        met = means.coupling
        points = _points(meeting, chosen, met.normal, met.gap, means.weights(len(coordinates)))
        points = with_symmetry(points, means.symmetric(), meeting.slave.planes)
        bent = np.zeros((points.count, self.scene.dim, self.scene.dim))
        return points, without_patches(bent, len(coordinates)), means

    def _on_patches(
        self,
        index: int,
        meeting: Meeting,
        coordinates: np.ndarray,
        last: Known | None,
        start: MaterialPoints | None,
    ) -> tuple[ContactPoints, Differential, np.ndarray]:
        patches = meeting.patches
        assert patches is not None
        known = _last_facets(meeting, index, last, self.scene.dim - 1)
        met = known[0] >= 0
        if start is not None:
            mine = start.pair == index
            met[np.searchsorted(meeting.nodes, start.key[mine] - index * len(coordinates))] = True
        hit = meeting.closest(coordinates, known, met, self.reach, self.comm)
        own = coordinates[meeting.master_nodes]
        at = patch_points(patches, patches.coefficients(own)[hit.facet], hit.local)
        count = len(coordinates), len(meeting.master_nodes)
        spread = sp.csr_matrix((np.ones(count[1]), (np.arange(count[1]), meeting.master_nodes)), count[::-1])
        weights, *slopes = (
            (patches.weights(hit.facet, values) @ spread).tocsr()
            for values in (at.functions.value, *np.moveaxis(at.functions.first, 2, 0))
        )
        points = _points(meeting, hit.point, at.normal, hit.gap, weights)
        points = replace(points, facet=hit.facet, local=hit.local)
        cut = _symmetric(meeting, points, hit.facet, hit.local)
        points = with_symmetry(points, cut, meeting.slave.planes)
        bend = np.einsum("nabd,nd->nab", at.second, at.normal)
        curvature = np.zeros((points.count, self.scene.dim, self.scene.dim))
        return points, Differential(at.tangents, bend, tuple(slopes), curvature), meeting.nodes[hit.lost]


def _points(
    meeting: Meeting, chosen: np.ndarray, normal: np.ndarray, distance: np.ndarray, weights: sp.csr_matrix
) -> ContactPoints:
    """Return points at candidates, not yet numbered by pair and without facets."""
    count, axes = len(chosen), reference_axes(normal)
    taken = None if meeting.taken is None else meeting.taken[chosen]
    return ContactPoints(
        np.zeros(count, dtype=np.int64), meeting.nodes[chosen], weights, normal, tangent_frames(normal, axes),
        distance + meeting.offset[chosen], meeting.area[chosen], np.full(count, -1),
        np.zeros((count, normal.shape[1] - 1)), axes, np.zeros(normal.shape, dtype=bool), distance,
        meeting.given[chosen], taken,
    )  # fmt: skip


def _where_they_lie(points: ContactPoints, meeting: Meeting, chosen: np.ndarray) -> ContactPoints:
    """Return points of candidates that may lie inside facets of the slave."""
    if (meeting.on_facet < 0).all():
        return points
    own = meeting.own[chosen].tocoo()
    entries = own.data, (own.row, meeting.slave_nodes[own.col])
    inside = sp.csr_matrix(entries, shape=points.master.shape)
    facet, local = meeting.on_facet[chosen], meeting.on_local[chosen]
    return replace(points, inside=inside, slave_facet=facet, slave_local=local)


def _carried(weights: np.ndarray, nodes: np.ndarray, count: int) -> sp.csr_matrix:
    """Return weights of a few nodes, shape (n, k), as those of all of them, (n, count)."""
    rows = weights.shape[1] * np.arange(len(weights) + 1)
    return sp.csr_matrix((weights.ravel(), np.tile(nodes, len(weights)), rows), shape=(len(weights), count))


def _last_facets(
    meeting: Meeting, index: int, last: Known | None, width: int
) -> tuple[np.ndarray, np.ndarray]:
    facet, local = np.full(len(meeting.candidates), -1), np.zeros((len(meeting.candidates), width))
    if last is not None:
        mine = last.pair == index
        place = np.searchsorted(meeting.nodes, last.slave[mine])
        facet[place], local[place] = last.facet[mine], last.local[mine]
    return facet, local


def _kept_axes(points: ContactPoints, last: Known, index: int, steepest: float = 0.9) -> np.ndarray:
    """Return the axes nearest to the first tangents: the last ones, unless they come near the normal."""
    axes, before = points.axes.copy(), np.flatnonzero(last.pair == index)
    _, now, then = np.intersect1d(points.slave, last.slave[before], return_indices=True)
    old = last.axes[before[then]]
    stays = np.abs(np.einsum("nd,nd->n", old, points.normal[now])) < steepest
    axes[now[stays]] = old[stays]
    return axes


def _symmetric(meeting: Meeting, points: ContactPoints, facet: np.ndarray, local: np.ndarray) -> np.ndarray:
    """Return the symmetry planes that cut both surfaces at a point, (n, n_planes)."""
    assert meeting.patches is not None
    corners = meeting.patches.facets[facet]
    shares, _ = shape_functions(local, corners.shape[1])
    there = np.einsum("nk,nkd->nd", np.abs(shares), ~meeting.master_cut[corners]) < 0.05
    own = np.zeros((int(meeting.slave_nodes.max(initial=-1)) + 1, there.shape[1]), dtype=bool)
    own[meeting.slave_nodes] = meeting.slave.mirrored
    return np.asarray(there & own[points.slave])
