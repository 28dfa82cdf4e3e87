"""The contact points of moved bodies with their derivatives and slip."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, replace
from functools import cached_property

import numpy as np
import scipy.sparse as sp
from scipy.spatial import cKDTree

from fenics_contact._base.csr import Csr
from fenics_contact._base.fingerprint import described, require_alike
from fenics_contact._base.libraries import MPI
from fenics_contact._base.sparse import scaled_rows
from fenics_contact._pairing.masters import Placements
from fenics_contact._pairing.points import ContactPoints
from fenics_contact._pairing.search import find_contact_points, in_reach
from fenics_contact._pairing.sliding.means import MeanTangents, MovingMeans, PointAreas, interleaved, placed
from fenics_contact._pairing.sliding.meeting import SlidingPair
from fenics_contact._pairing.sliding.slip import LAST, MaterialPoints, slip_by_start, slip_by_start_of_means
from fenics_contact._pairing.sliding.stiffness import (
    Differential,
    GeometricStiffness,
    LowRank,
    frame_changes,
    friction_stiffness,
    geometric_stiffness,
    point_motion,
    spread,
)
from fenics_contact._scene.pairs import ContactPair
from fenics_contact._scene.scene import Scene
from fenics_contact.errors import together


def with_given_offsets(
    meetings: tuple[SlidingPair, ...], scene: Scene, stood: ContactPoints, fixed: np.ndarray, comm: MPI.Comm
) -> tuple[SlidingPair, ...]:
    """Return the pairs with the offsets that their given gaps need. Collective.

    The gap of a node counts from its distance as it is measured while bodies move, which by mortar is one
    between facets and may differ from that of the true surfaces: in the given geometry, undeformed, it is
    what the pair says.

    `fixed`: whether a component of a node is prescribed, shape (n_nodes, dim); `comm`: communicator of the
    ranks; all have the same pairs and points.
    """
    first = find_contact_points(scene, fixed, comm)
    result = []
    for index, (meeting, pair) in enumerate(zip(meetings, scene.contacts, strict=True)):
        if not pair.given_gap:
            result.append(meeting)
            continue
        place = scene.points[meeting.nodes]
        with together(comm):
            offset, given = _offsets(meeting, pair, place, first, stood, index)
        require_alike(comm, described(offset, f"the gap given between {pair.place}"))
        result.append(replace(meeting, offset=offset, given=given))
    return tuple(result)


def _offsets(
    meeting: SlidingPair,
    pair: ContactPair,
    place: np.ndarray,
    first: ContactPoints,
    stood: ContactPoints,
    index: int,
) -> tuple[np.ndarray, np.ndarray]:
    """Return what is added to the gap of each candidate, and whether the pair gives its gap."""
    measured, moving = (_of_candidates(meeting, points, index) for points in (first, stood))
    faced = ~np.isnan(measured)
    near = faced & in_reach(pair, np.where(faced, measured, np.inf), place)
    moving = np.where(np.isnan(moving), measured, moving)
    if pair.gives_all_gaps:  # nodes that meet the master only later continue what is next to them
        _, next_to = cKDTree(place[faced]).query(place[~faced])
        moving[~faced] = moving[faced][next_to]
        near[:] = True
    wanted = pair.gap_at(place) if near.any() else None
    target = np.zeros(len(place)) if wanted is None else wanted
    return np.where(near, target - moving, 0.0), near | (pair.interference == "measured")


def _of_candidates(meeting: SlidingPair, points: ContactPoints, index: int) -> np.ndarray:
    """Return the distances of a pair's points at its candidates, NaN where these have none, [length]."""
    distance, mine = np.full(len(meeting.candidates), np.nan), points.pair == index
    mine &= np.isin(points.slave, meeting.nodes)  # tied nodes are no candidates
    distance[np.searchsorted(meeting.nodes, points.slave[mine])] = points.distance[mine]
    return distance


@dataclass(frozen=True)
class SlidingPoints:
    """Contact points of bodies where they lie now, replicated.

    Attributes:
        points: The points; gap, normal and weights are those of the present coordinates, areas those of the
            reference configuration. The weights reach the nodes around a facet.
        coordinates: Present coordinates of all nodes, shape (n_nodes, dim), [length].
        means: The couplings of mortar contact, by their pairs.
        placements: Where obstacles are that move, by their pairs.
        lost: Slave nodes that face a facet but for which no closest point was found.
    """

    points: ContactPoints
    coordinates: np.ndarray
    means: Mapping[int, MovingMeans]
    placements: Placements
    differential: Differential
    lost: np.ndarray

    @cached_property
    def key(self) -> np.ndarray:
        """Number of each point that stays the same from call to call, ascending, shape (n,)."""
        return np.asarray(self.points.pair * len(self.coordinates) + self.points.slave)

    def carry(self, values: np.ndarray, other: SlidingPoints) -> np.ndarray:
        """Return values of another set of points at these, zero where it has no such point.

        `values`: values at the other points, shape (n_other, ...).
        """
        result = np.zeros((self.points.count, *values.shape[1:]), dtype=values.dtype)
        _, here, there = np.intersect1d(self.key, other.key, assume_unique=True, return_indices=True)
        result[here] = values[there]
        return result

    def carry_tangential(self, friction: np.ndarray, other: SlidingPoints) -> np.ndarray:
        """Return tangential forces of another set of points in these points' frames, shape (n, dim − 1).

        They turn with the normals, by the smallest rotation.

        `friction`: forces in the other points' tangents, shape (n_other, dim − 1).
        """
        vectors = np.einsum("na,nad->nd", friction, other.points.tangents)
        return self._in_frames(self.carry(vectors, other), self.carry(other.points.normal, other))

    def carry_slip(self, slip: np.ndarray, other: SlidingPoints) -> np.ndarray:
        """Return the slip at another set of points in these points' frames, shape (n, dim − 1).

        It turns with the master where the nodes stand now, from there by the smallest rotation of normals:
        what bodies that turn together have slipped before stays what it is beside them.

        `slip`: slip in the other points' tangents, shape (n_other, dim − 1), [length].
        """
        turn = self._turned_masters(other)
        vectors = self.carry(np.einsum("na,nad->nd", slip, other.points.tangents), other)
        normals = self.carry(other.points.normal, other)
        return self._in_frames(*(np.einsum("nde,ne->nd", turn, each) for each in (vectors, normals)))

    def _in_frames(self, vectors: np.ndarray, before: np.ndarray) -> np.ndarray:
        """Return vectors across earlier normals, both (n, dim), in the present frames, (n, dim − 1)."""
        normal = self.points.normal
        cosine = np.einsum("nd,nd->n", before, normal)
        along = np.einsum("nd,nd->n", vectors, normal) / np.maximum(1.0 + cosine, 1e-12)
        turned = vectors - along[:, None] * (before + normal)
        return np.asarray(np.einsum("nd,nad->na", turned, self.points.tangents))

    def _turned_masters(self, other: SlidingPoints, least: float = 1e-6) -> np.ndarray:
        """Return the rotations of the masters since another set of points, shape (n, dim, dim).

        On a body it is the one that turns the nodes which a point meets now from their places then, about
        their mean. Where these lie on a line, normals decide, with the weight ``least``.
        """
        met = abs(self.points.master).tocsr()
        count, dim = self.points.normal.shape
        row, of_rows = _entries_by_row(met)
        size = np.maximum(np.asarray(met.sum(axis=1)), np.finfo(float).tiny)
        now, then = (
            places[met.indices] - (met @ places / size)[row]
            for places in (self.coordinates, other.coordinates)
        )
        products = (now[:, :, None] * then[:, None, :]).reshape(len(row), dim * dim)
        moment = np.asarray(of_rows @ products).reshape(count, dim, dim)
        normals = self.points.normal[:, :, None] * self.carry(other.points.normal, other)[:, None]
        scale = least * np.abs(moment).sum(axis=(1, 2))[:, None, None]
        left, _, right = np.linalg.svd(moment + scale * normals)
        left[:, :, -1] *= np.linalg.det(left @ right)[:, None]
        rotation = np.asarray(left @ right)
        rotation[np.diff(met.indptr) == 0] = np.eye(dim)
        for index, turn in self._obstacle_turns(other).items():
            rotation[self.points.pair == index] = turn
        return rotation

    def _obstacle_turns(self, other: SlidingPoints) -> dict[int, np.ndarray]:
        """Return the rotations of moving obstacles since another set of points, by their pairs.

        A load step may leave out the last pairs, or have them again.
        """
        both = self.placements.keys() & other.placements.keys()
        return {index: self.placements[index][0] @ other.placements[index][0].T for index in both}

    def areas(self, scene: Scene) -> PointAreas:
        """Return the areas that belong to the points, given the scene in its reference configuration."""
        return PointAreas.of(scene, self.points, self.coordinates, self.means)

    def met_areas_pulled_back(self, by_met: np.ndarray) -> np.ndarray:
        """Vector-Jacobian product of parts that face masters with respect to the coordinates. Collective.

        `by_met`: derivative by the areas of the slave that face the master, of mortar contact alone, (n,).

        The result has shape (n_nodes, dim).
        """
        result = np.zeros_like(self.coordinates)
        for mine, means in self._by_means:
            if by_met[mine].any():
                by_slave, by_master = means.areas_pulled_back(by_met[mine])
                result[means.slave_nodes] += by_slave
                result[means.master_nodes] += by_master
        return result

    def stiffness(self, multiplier: np.ndarray) -> GeometricStiffness:
        """Return the derivative of the normal forces by the coordinates, see `geometric_stiffness`."""
        return geometric_stiffness(self.points, self.differential, multiplier)

    def friction_stiffness(self, friction: np.ndarray) -> LowRank:
        """Return the derivative of the friction forces by the coordinates, see `friction_stiffness`."""
        return friction_stiffness(self.points, self.differential, friction)

    def material_points(self, elastic: np.ndarray | None = None) -> MaterialPoints:
        """Return where the nodes stand on their masters, for the slip from now on.

        With an elastic slip, in the points' tangents, shape (n, dim − 1), [length], it is where springs
        between nodes and masters are at rest: what is carried along and turns with the masters.
        """
        points, weights = self.points, self.points.master
        foot = points.own @ self.coordinates - points.distance[:, None] * points.normal
        if elastic is not None:
            way = np.einsum("na,nad->nd", elastic, points.tangents)
            foot, weights = foot - way, weights - self._moving_by(way)
        carried = np.diff(points.master.indptr) > 0
        foot[carried] = 0.0
        for index, (rotation, translation) in self.placements.items():
            mine = (points.pair == index) & ~carried
            foot[mine] = (foot[mine] - translation) @ rotation
        return MaterialPoints(self.key, points.pair, weights, foot)

    def _moving_by(self, way: np.ndarray, flat: float = 1e-6) -> sp.csr_matrix:
        """Return weights of masters' nodes whose sums are zero, and Σ W_j x_j a way along their surface.

        They change linearly across the nodes around a point. `way`: shape (n, dim); `flat`: thickness of a
        flat surface.
        """
        met = sum((abs(slopes) for slopes in self.differential.slopes), abs(self.points.master)).tocsr()
        row, of_rows = _entries_by_row(met)
        centre = met @ self.coordinates / np.maximum(np.asarray(met.sum(axis=1)), np.finfo(float).tiny)
        arm = self.coordinates[met.indices] - centre[row]
        (count, dim), products = way.shape, arm[:, :, None] * arm[:, None]
        moment = np.asarray(of_rows @ products.reshape(len(row), dim * dim)).reshape(count, dim, dim)
        slope = np.einsum("nde,ne->nd", np.linalg.pinv(moment, rcond=flat, hermitian=True), way)
        values = met.data * np.einsum("jd,jd->j", arm, slope[row])
        return Csr((values, met.indices, met.indptr), shape=met.shape)

    def stored(self, start: MaterialPoints) -> dict[str, np.ndarray]:
        """Return the arrays from which `SlidingContact.found_again` finds the same points."""
        found = {f"found.{name}": getattr(self.points, name) for name in LAST}
        return found | start.stored()

    def mean_tangents(
        self, normal: np.ndarray, friction: np.ndarray, start: MaterialPoints, *, apart: bool = False
    ) -> MeanTangents:
        """Return what derivatives of mortar contact have beside the rows of its forces. Collective.

        `normal`: λ_N, shape (n,), [force]; `friction`: τ in the points' tangents, shape (n, dim − 1),
        [force]; `apart`: whether points that carry forces may keep a distance, at which the slip has a lever.
        """
        (way, weights), count = self._way(start), self.points.count
        total = MeanTangents.none(count, friction.shape[1], self.coordinates.size)
        for mine, means in self._by_means:
            forces = normal[mine], friction[mine]
            found = means.tangents(
                self.points.part(mine), self.coordinates, forces, (way[mine], weights[mine])
            )
            total = found if len(mine) == count else total.with_points(mine, found)
        # In the plane a slipping force does not turn with the slip, of which nothing is needed then.
        if (apart or friction.shape[1] == 2) and friction.any():
            total = replace(total, slip=total.slip + self._slip_beyond_rows(start, np.any(friction, axis=1)))
        return total

    def _slip_beyond_rows(self, start: MaterialPoints, rubbed: np.ndarray) -> sp.csr_matrix:
        """Return the derivative of the slip of nodes less the rows of their friction forces."""
        chosen = rubbed.copy()
        for mine, _ in self._by_means:
            chosen[mine] = False
        points, width = self.points, self.points.normal.shape[1] - 1
        if not chosen.any():
            return Csr((points.count * width, self.coordinates.size))
        rows = interleaved([spread(points.tangents[:, c], points.jump) for c in range(width)])
        return scaled_rows((self.slip_rows(start) - rows).tocsr(), np.repeat(chosen, width).astype(float))

    def means_pulled_back(
        self, normal: np.ndarray, friction: np.ndarray, by_gap: np.ndarray, field: np.ndarray
    ) -> np.ndarray:
        """Return the derivative of −fᵀ field + by_gapᵀ g by the coordinates, of means alone. Collective.

        That is, of the contact forces f of mortar contact at fixed multipliers, and of its gaps g beside
        `gap_rows`.

        `normal`: λ_N, shape (n,), [force]; `friction`: τ in the points' tangents, shape (n, dim − 1),
        [force]; `by_gap`: shape (n,); `field`: by dof of all nodes, shape (n_dofs,).
        """
        total = np.zeros(self.coordinates.size)
        for mine, means in self._by_means:
            some, by, forces = self.points.part(mine), by_gap[mine], (normal[mine], friction[mine])
            motion = means.motion(some, (by != 0.0) | (forces[0] != 0.0) | forces[1].any(axis=1))
            stiffness = motion.stiffness(some, *forces)
            total += motion.gap_rows(some, self.coordinates).T @ by
            total -= stiffness.right @ (stiffness.left.T @ field)
        return total

    @property
    def moving_nodes(self) -> np.ndarray:
        """Nodes on whose coordinates points depend, among those of all bodies, ascending."""
        reached = [self.points.jump.indices, *(slopes.indices for slopes in self.differential.slopes)]
        for _, means in self._by_means:
            reached += [means.slave_nodes, means.master_nodes]
        return np.unique(np.concatenate(reached))

    def slip(self, start: MaterialPoints) -> np.ndarray:
        """Return t_a·(x_s − x_m), x_m where the node stood at the start, carried along by the master.

        Unchanged when everything moves as one rigid piece. Nodes without a point at the start have no slip,
        see `MaterialPoints.extended`.

        Returns slip in the present tangents, shape (n, dim − 1), [length].
        """
        way, _ = self._way(start)
        return np.asarray(np.einsum("nd,nad->na", way, self.points.tangents))

    @property
    def gap_rows(self) -> sp.csr_matrix:
        """Derivative of the gaps by all coordinates, shape (n, n_dofs), dof dim · node + component."""
        return spread(self.points.normal, self.points.jump)

    def slip_rows(self, start: MaterialPoints) -> sp.csr_matrix:
        """Return the derivative of `slip` by all coordinates, (n · (dim − 1), n_dofs), dof dim · node + a.

        It differs from the rows t_a·(δx_s − Σ W_j δx_j) of the friction forces, by the weights at the start
        and by the turning of the tangents, as far as nodes slip.
        """
        points, (way, weights) = self.points, self._way(start)
        motion = point_motion(points, self.differential)
        turned = frame_changes(points.normal, points.axes, motion.directions)
        count, width = points.count, points.normal.shape[1] - 1
        jump, parts = (self._standing - weights).tocsr(), []
        for c in range(width):
            rows = spread(points.tangents[:, c], jump)
            for a in range(width):
                rows = rows + scaled_rows(motion.turn[a], np.einsum("nd,nd->n", turned[:, c, a], way))
            parts.append(rows)
        for mine, means in self._by_means:
            some = points.part(mine)
            moved = means.motion(some, np.ones(len(mine), dtype=bool))
            for c, rows in enumerate(moved.slip_rows(some, self.coordinates, way[mine])):
                parts[c] = parts[c] + placed(mine, count) @ rows
        return interleaved(parts)

    def slip_by_start(self, start: SlidingPoints) -> sp.csr_matrix:
        """Return the derivative of `slip` by the coordinates at its start, shaped as `slip_rows`."""
        _, here, there = np.intersect1d(self.key, start.key, assume_unique=True, return_indices=True)
        by_nodes, known = np.setdiff1d(start.points.pair, list(start.means)), self._obstacle_turns(start)
        turned = {int(index): known.get(index, np.eye(self.coordinates.shape[1])) for index in by_nodes}
        result = slip_by_start(
            self.points, self.coordinates, start.points, start.differential, (here, there), turned
        )
        for mine, means in start._by_means:
            moved = slip_by_start_of_means(
                self.points, self.coordinates, (start.points, mine), means, (here, there)
            )
            result = result + moved
        return result.tocsr()

    def _way(self, start: MaterialPoints) -> tuple[np.ndarray, sp.csr_matrix]:
        """Return x_s − x_m, shape (n, dim), and the weights of nodes in x_m, shape (n, n_nodes)."""
        if not np.isin(self.key, start.key).all():
            start = start.extended(self.material_points())
        start = start.part(np.searchsorted(start.key, self.key))
        place = start.place.copy()
        for index, (rotation, translation) in self.placements.items():
            mine = np.flatnonzero((start.pair == index) & (np.diff(start.weights.indptr) == 0))
            place[mine] = place[mine] @ rotation.T + translation
        way = self._standing @ self.coordinates - place - start.weights @ self.coordinates
        return np.asarray(way), start.weights

    @cached_property
    def _standing(self) -> sp.csr_matrix:
        """Weights of nodes in where each point stands: its node, with mortar the mean that it meets."""
        at_node = np.ones(self.points.count)
        for mine, _ in self._by_means:
            at_node[mine] = 0.0
        own = scaled_rows(self.points.own, at_node)
        return (own + scaled_rows(self.points.master, 1.0 - at_node)).tocsr()

    @property
    def _by_means(self) -> list[tuple[np.ndarray, MovingMeans]]:
        """The points of each pair of mortar contact with its coupling."""
        return [(np.flatnonzero(self.points.pair == index), means) for index, means in self.means.items()]


def _entries_by_row(matrix: sp.csr_matrix) -> tuple[np.ndarray, sp.csr_matrix]:
    """Return the row of each entry, and the matrix that sums values of entries by row, weighted by them."""
    row = np.repeat(np.arange(matrix.shape[0]), np.diff(matrix.indptr))
    each = np.arange(len(row))
    return row, Csr((matrix.data, each, matrix.indptr), shape=(matrix.shape[0], len(row)))
