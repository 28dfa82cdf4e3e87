"""Where the gap is smaller inside facets of a slave than at their nodes.

A convex master that is narrower than the slave's cells passes between its nodes. The smallest gap in each
facet is found from samples, and from there by steps along the facet's coordinates that are halved: gaps need
not have derivatives, and near their minimum they hardly change.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, fields, replace
from functools import partial
from typing import ClassVar

import numpy as np
import scipy.sparse as sp

from fenics_contact._base.csr import Csr
from fenics_contact._pairing.following import followed_nodes
from fenics_contact._pairing.masters import Master, Placements, master_of
from fenics_contact._pairing.points import (
    ContactPoints,
    NodeNumbers,
    in_free_frames,
    reference_axes,
    tangent_frames,
)
from fenics_contact._scene.local_axes import LocalAxes
from fenics_contact._scene.pairs import ContactPair
from fenics_contact._scene.parts import surface_of
from fenics_contact._scene.scene import Scene
from fenics_contact._surfaces.facets import (
    FacetedSurface,
    corner_places,
    facet_shape_values,
    heights,
    outside,
)
from fenics_contact._surfaces.pieces import shape_weights
from fenics_contact._surfaces.projection import interpolated_normal

#: Gaps at points of facets: numbers of facets, (n,), local coordinates, (n, dim − 1) -> (n,), [length].
GapsAt = Callable[[np.ndarray, np.ndarray], np.ndarray]

#: Samples along each local coordinate.
SAMPLES = 5
#: How often steps are halved.
HALVINGS = 8
#: Weight of nodes off a plane of symmetry below which a point lies on it.
ON_PLANE = 1e-9
#: Gaps that differ by less than this part of how much they vary in a facet are the same.
FLAT = 1e-3


@dataclass(frozen=True, eq=False)
class Deepest:
    """The points of some facets where the gap is smallest.

    Attributes:
        facet: Their numbers, ascending, shape (n,).
        local: Local coordinates, shape (n, dim − 1).
        gap: Shape (n,), [length].
        at_nodes: The smallest gap at the corners of each facet, shape (n,), [length].
    """

    facet: np.ndarray
    local: np.ndarray
    gap: np.ndarray
    at_nodes: np.ndarray

    @property
    def missed(self) -> np.ndarray:
        """By how much facets lie deeper in the master than their corners do, shape (n,), [length]."""
        return np.asarray(np.maximum(np.minimum(self.at_nodes, 0.0) - self.gap, 0.0))

    def part(self, chosen: np.ndarray) -> Deepest:
        """Return some of them, by indices or a mask."""
        return Deepest(self.facet[chosen], self.local[chosen], self.gap[chosen], self.at_nodes[chosen])


@dataclass(frozen=True, eq=False)
class Sampled:
    """Gaps at samples of some facets, of which those at corners are no part.

    Attributes:
        facet: Numbers of the facets, ascending, shape (n,).
        gap: Shape (n, m), [length].
        varies: By how much gaps vary in each facet, corners included, shape (n,), [length].
        at_nodes: The smallest gap at the corners of each facet, shape (n,), [length].
    """

    facet: np.ndarray
    gap: np.ndarray
    varies: np.ndarray
    at_nodes: np.ndarray

    @classmethod
    def of(cls, corners: int, facet: np.ndarray, gaps_at: GapsAt) -> Sampled:
        """Return those of facets with so many corners; `gaps_at`: gaps at their points."""
        places = np.concatenate([_samples(corners), corner_places(corners)])
        every = gaps_at(np.repeat(facet, len(places)), np.tile(places, (len(facet), 1)))
        every = every.reshape(len(facet), len(places))
        found, at_ends = np.split(every, [-corners], axis=1)
        finite = np.where(np.isfinite(every), every, np.nan)
        highest, lowest = (of(finite, axis=1, initial=0.0) for of in (np.nanmax, np.nanmin))
        return cls(facet, found, np.nan_to_num(highest - lowest), at_ends.min(axis=1, initial=np.inf))

    @classmethod
    def join(cls, parts: Sequence[Sampled]) -> Sampled:
        """Return those of several groups of facets, at least one."""
        order = np.argsort(np.concatenate([part.facet for part in parts]))
        names = [each.name for each in fields(cls)]
        return cls(*(np.concatenate([getattr(part, name) for part in parts])[order] for name in names))

    def may_miss(self, least: float) -> np.ndarray:
        """Return which facets may lie deeper than their corners by more than a depth, shape (k,).

        Between samples the gap is lower by no more than a small part of how much it varies.
        """
        lowest = self.gap.min(axis=1, initial=np.inf)
        return np.flatnonzero(lowest < np.minimum(self.at_nodes, 0.0) - least + 0.1 * self.varies)


def deepest_points(corners: int, sampled: Sampled, gaps_at: GapsAt, least: float = 0.0) -> Deepest:
    """Return the deepest points of those facets that miss more than a depth.

    `corners`: of a facet; `sampled`: the facets; `gaps_at`: gaps at their points; `least`: the depth,
    [length].
    """
    near, samples = sampled.may_miss(least), _samples(corners)
    facet, found, varies = sampled.facet[near], sampled.gap[near], sampled.varies[near]
    lowest = found.min(axis=1, initial=np.inf)
    flat = (found <= (lowest + FLAT * varies)[:, None]).astype(float)
    middle = flat @ samples / flat.sum(axis=1, keepdims=True)
    alone = samples[np.argmin(found, axis=1)]
    in_middle = gaps_at(facet, middle)
    local = np.where((in_middle <= lowest + FLAT * varies)[:, None], middle, alone)
    gap = np.minimum(in_middle, np.where(in_middle <= lowest + FLAT * varies, in_middle, lowest))
    local, gap = _descended(corners, facet, gaps_at, local, gap, 1e-3 * FLAT * varies)
    result = Deepest(facet, local, gap, sampled.at_nodes[near])
    return result.part(result.missed > least)


def _samples(corners: int) -> np.ndarray:
    """Return places in facets, none at corners, shape (m, dim − 1)."""
    if corners == 3:
        steps = np.arange(1, SAMPLES + 1) / (SAMPLES + 2)
        s, t = (each.ravel() for each in np.meshgrid(steps, steps, indexing="ij"))
        inside = s + t < 1.0 - 0.5 / (SAMPLES + 2)
        return np.column_stack([s[inside], t[inside]])
    steps = (2.0 * np.arange(SAMPLES) + 1.0) / SAMPLES - 1.0
    if corners == 2:
        return steps[:, None]
    return np.stack(np.meshgrid(steps, steps, indexing="ij"), axis=-1).reshape(-1, 2)


def _descended(
    corners: int, facet: np.ndarray, gaps_at: GapsAt, local: np.ndarray, gap: np.ndarray, same: np.ndarray
) -> tuple[np.ndarray, np.ndarray]:
    """Return lower points of facets, by steps along their coordinates that are halved, and their gaps.

    `same`: changes of gaps that are none, shape (n,), [length].
    """
    width, size = local.shape[1], (1.0 if corners == 3 else 2.0) / SAMPLES
    for _ in range(HALVINGS):
        size *= 0.5
        for along in np.concatenate([np.eye(width), -np.eye(width)]):
            tried, there = local + size * along, np.full(len(facet), np.inf)
            inside = outside(tried, corners) == 0.0
            if inside.any():
                there[inside] = gaps_at(facet[inside], tried[inside])
            lower = there < gap - same
            local, gap = np.where(lower[:, None], tried, local), np.where(lower, there, gap)
    return local, gap


@dataclass(frozen=True, eq=False)
class PointsInside:
    """Points of facets of a slave with what they meet on its master, undeformed.

    Attributes:
        distance: From the master, infinite where they do not face it, shape (n,), [length].
        normal: From master to slave, shape (n, dim).
        own: Weights of the nodes of all bodies in their displacements, shape (n, n_nodes).
        master: The same of what they meet, empty rows on an obstacle, shape (n, n_nodes).
    """

    distance: np.ndarray
    normal: np.ndarray
    own: sp.csr_matrix
    master: sp.csr_matrix

    def gap(self, moved: np.ndarray) -> np.ndarray:
        """Return the gaps after small displacements of all nodes, shape (n_nodes, dim)."""
        return np.asarray(
            self.distance + np.einsum("nd,nd->n", self.normal, self.own @ moved - self.master @ moved)
        )


@dataclass(frozen=True, eq=False)
class InsideOf:
    """The surfaces of a pair, between whose nodes gaps are looked for.

    Attributes:
        nodes: Nodes of the slave among those of all bodies, shape (n_slave,).
    """

    scene: Scene
    slave: FacetedSurface
    nodes: np.ndarray
    master: Master

    @classmethod
    def of(cls, scene: Scene, pair: ContactPair) -> InsideOf:
        """Return those of a pair of a scene."""
        slave = surface_of(scene, pair.slave, pair.slave_geometry)
        nodes = NodeNumbers.of(scene).global_nodes(pair.slave.body, slave.nodes)
        return cls(
            scene, slave, nodes, master_of(scene, pair, partial(surface_of, scene, geometry=pair.geometry))
        )

    def moved(self, number: int, coordinates: np.ndarray, placements: Placements) -> InsideOf:
        """Return them where bodies are that deform much, made of their facets.

        `number`: of the pair; `coordinates`: of all nodes, shape (n_nodes, dim), [length].
        """
        from fenics_contact._pairing.sliding.closest import moved_surface

        slave, master = moved_surface(self.slave, coordinates[self.nodes]), self.master
        return replace(self, slave=slave, master=master.moved(number, coordinates, placements))

    def at(self, facet: np.ndarray, local: np.ndarray) -> PointsInside:
        """Return points of the slave by facet, shape (n,), and local coordinates, shape (n, dim − 1)."""
        slave, values = self.slave, facet_shape_values(local, self.slave.corners)
        at_corners = slave.facets[facet]
        normal, _ = interpolated_normal(values, slave.normals[at_corners])
        nodes, weights = shape_weights(slave, facet, values)
        if slave.relief is None:
            place = np.einsum("nk,nkd->nd", weights, slave.points[nodes])
        else:
            place = np.einsum("nk,nkd->nd", values, slave.points[at_corners])
            place += heights(slave, facet, local).value[:, None] * normal
        row = np.repeat(np.arange(len(nodes)), nodes.shape[1])
        entries = weights.ravel(), (row, self.nodes[nodes].ravel())
        own = Csr(entries, shape=(len(nodes), len(self.scene.points)))
        met = self.master.met(place, normal)
        return PointsInside(met.distance, met.normal, self._following(own), self._following(met.weights))

    def _following(self, rows: sp.csr_matrix) -> sp.csr_matrix:
        """Return weights of nodes as those of all but hanging ones."""
        return (rows @ followed_nodes(self.scene)).tocsr() if self.scene.has_hanging_nodes else rows

    def pressed_in(self, facet: np.ndarray, local: np.ndarray, opened_at: GapsAt) -> np.ndarray:
        """Return by how much more gaps have opened at points than at the nodes around their facets, (n,).

        `opened_at`: by how much they have opened at points of facets.
        """
        slave = self.slave
        rows = slave.corners * np.arange(len(slave.facets) + 1)
        entries = np.ones(slave.facets.size), slave.facets.ravel(), rows
        has = Csr(entries, shape=(len(slave.facets), len(slave.nodes)))
        around = ((has[facet] @ has.T @ has) > 0).astype(float)
        around = (around - around.multiply(has[facet])).tocsr()
        around.eliminate_zeros()
        needed = np.unique(around.indices)
        opened = np.zeros(len(slave.nodes))
        opened[needed] = opened_at(*self.at_nodes(needed))
        met = np.isfinite(opened)
        count = around @ met.astype(float)
        mean = around @ np.where(met, opened, 0.0) / np.maximum(count, 1.0)
        own = opened_at(facet, local)
        return np.where((count > 0.0) & np.isfinite(own), np.maximum(np.nan_to_num(own) - mean, 0.0), 0.0)

    def at_nodes(self, nodes: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """Return nodes, by their positions, as corners of facets: these and local coordinates."""
        first = np.zeros(len(self.slave.nodes), dtype=np.int64)
        first[self.slave.facets.ravel()] = np.arange(self.slave.facets.size)
        facet, corner = np.divmod(first[nodes], self.slave.corners)
        return facet, corner_places(self.slave.corners)[corner]

    def bulge(self, facet: np.ndarray, local: np.ndarray, gaps_at: GapsAt) -> np.ndarray:
        """Return by how much gaps at points are smaller than displacements between gaps at nodes, (n,).

        `gaps_at`: gaps at points of facets.
        """
        slave, values = self.slave, facet_shape_values(local, self.slave.corners)
        nodes, weights = shape_weights(slave, facet, values)
        needed, place = np.unique(nodes, return_inverse=True)
        at_nodes = gaps_at(*self.at_nodes(needed))[place.reshape(nodes.shape)]
        between = np.einsum("nk,nk->n", weights, np.where(weights != 0.0, at_nodes, 0.0))
        return np.asarray(between - gaps_at(facet, local))

    def cut(self, facet: np.ndarray, local: np.ndarray) -> np.ndarray:
        """Return which planes of symmetry cut the slave at points, shape (n, n_planes)."""
        values = facet_shape_values(local, self.slave.corners)
        off = ~self.slave.mirrored[self.slave.facets[facet]]
        return np.asarray(np.einsum("nk,nkp->np", np.abs(values), off) < ON_PLANE)

    @property
    def sizes(self) -> np.ndarray:
        """Widths of the facets, shape (n_facets,), [length]."""
        corners = self.slave.points[self.slave.facets]
        return np.asarray(np.linalg.norm(np.ptp(corners, axis=1), axis=1))


@dataclass(frozen=True, eq=False)
class InFacets:
    """Points inside facets of slaves.

    Attributes:
        point: Numbers of contact points, shape (k,).
        facet: The facet in which each lies, shape (k,).
        local: Local coordinates on it, shape (k, dim − 1).
        relief: How far it may lie in the master, shape (k,), [length].
    """

    point: np.ndarray
    facet: np.ndarray
    local: np.ndarray
    relief: np.ndarray

    _NAMES: ClassVar = ("point", "facet", "local", "relief")

    @classmethod
    def of(cls, points: ContactPoints) -> InFacets:
        """Return those of contact points."""
        which = points.are_inside
        relief = points.gap[which] - points.distance[which]
        return cls(which, points.slave_facet[which], points.slave_local[which], relief)

    def by_key(self, points: ContactPoints) -> InFacets:
        """Return them by the pairs and slave nodes of the points for their numbers."""
        return replace(self, point=_keys(points)[self.point])

    def by_number(self, points: ContactPoints) -> InFacets:
        """Return those by key that are among points, by the numbers of these."""
        _, here, number = np.intersect1d(self.point, _keys(points), return_indices=True)
        return replace(self.part(here), point=number)

    def stored(self) -> dict[str, np.ndarray]:
        """Return the arrays from which they are found again, none without any points."""
        return {f"inside.{name}": getattr(self, name) for name in self._NAMES} if len(self.point) else {}

    @classmethod
    def restored(cls, stored: Mapping[str, np.ndarray], dim: int) -> InFacets:
        """Return those of `stored`."""
        if "inside.point" not in stored:
            return cls.none(dim)
        return cls(*(stored[f"inside.{name}"] for name in cls._NAMES))

    def are_those_of(self, other: InFacets) -> bool:
        """Return whether both are the same."""
        return all(np.array_equal(getattr(self, name), getattr(other, name)) for name in self._NAMES)

    @classmethod
    def none(cls, dim: int) -> InFacets:
        """Return none in a space of a dimension."""
        nothing = np.zeros(0, dtype=np.int64)
        return cls(nothing, nothing, np.zeros((0, dim - 1)), np.zeros(0))

    def part(self, chosen: np.ndarray) -> InFacets:
        """Return some of them, by indices or a mask."""
        return InFacets(*(getattr(self, name)[chosen] for name in self._NAMES))

    @classmethod
    def join(cls, parts: Sequence[InFacets]) -> InFacets:
        """Return those of several groups, at least one."""
        return cls(*(np.concatenate([getattr(part, name) for part in parts]) for name in cls._NAMES))


def _keys(points: ContactPoints) -> np.ndarray:
    return np.asarray(points.pair * points.master.shape[1] + points.slave)


def points_inside(
    scene: Scene, points: ContactPoints, places: InFacets, fixed: np.ndarray, axes: LocalAxes
) -> ContactPoints:
    """Return contact points of which some lie inside facets of their slaves, all others at their nodes.

    `points`: all of them at nodes; `places`: where some of them lie in place of their node; `fixed`: whether
    a component of a node is prescribed, shape (n_nodes, dim), along its `axes`.
    """
    which = places.point
    if not len(which):
        return points
    on_facet, relief = np.full(points.count, -1), np.zeros(points.count)
    local, none = np.zeros((points.count, places.local.shape[1])), np.zeros(len(which), dtype=np.int64)
    on_facet[which], local[which], relief[which] = places.facet, places.local, places.relief
    found = replace(points, slave_facet=on_facet, slave_local=local)
    found = _put(found, scene, which)
    nearest, of_master = points.axes.copy(), points.facet.copy()
    nearest[which], of_master[which] = reference_axes(found.normal[which]), none - 1
    tangents = tangent_frames(found.normal, nearest)
    found = replace(found, axes=nearest, tangents=tangents, facet=of_master, gap=found.gap + relief)
    return in_free_frames(found, fixed, axes)


def _put(points: ContactPoints, scene: Scene, which: np.ndarray) -> ContactPoints:
    """Return points of which some measure the distance inside facets of their slaves."""
    own, master, symmetric = points.own.tolil(), points.master.tolil(), points.symmetric.copy()
    normal, gap, distance = points.normal.copy(), points.gap.copy(), points.distance.copy()
    oblique, dim = points.oblique_normals.copy(), points.normal.shape[1]
    for number in np.unique(points.pair[which]):
        chosen = which[points.pair[which] == number]
        inside = InsideOf.of(scene, scene.contacts[int(number)])
        at = points.slave_facet[chosen], points.slave_local[chosen]
        met, cut = inside.at(*at), inside.cut(*at)
        own[chosen], master[chosen], normal[chosen] = met.own, met.master, met.normal
        gap[chosen] = distance[chosen] = met.distance
        symmetric[chosen] = cut[:, :dim]
        oblique[chosen] = cut[:, dim:, None] * inside.slave.planes[dim:]
    return replace(
        points, own=own.tocsr(), master=master.tocsr(), normal=normal, gap=gap, distance=distance,
        symmetric=symmetric, oblique_normals=oblique,
    )  # fmt: skip
