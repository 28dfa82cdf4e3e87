"""What of a contact pair stays the same while its bodies move: nodes of its slave, and its counterpart."""

from __future__ import annotations

from abc import ABC, abstractmethod
from collections.abc import Mapping
from dataclasses import dataclass, field, replace
from itertools import product
from typing import TYPE_CHECKING, Any, Self, TypeAlias

import numpy as np
import scipy.sparse as sp

from fenics_contact._base.csr import Csr
from fenics_contact._base.libraries import MPI
from fenics_contact._pairing.inside import ON_PLANE, InFacets, InsideOf
from fenics_contact._pairing.masters import Placements
from fenics_contact._pairing.points import (
    PARALLEL,
    ContactPoints,
    NodeNumbers,
    are_beside,
)
from fenics_contact._pairing.sliding.closest import moved_surface
from fenics_contact._pairing.sliding.slip import LastPoints, MaterialPoints
from fenics_contact._pairing.sliding.stiffness import Differential
from fenics_contact._scene.obstacles import RigidPlane
from fenics_contact._scene.pairs import ContactPair, Surface
from fenics_contact._scene.scene import Scene
from fenics_contact._surfaces.facets import FacetedSurface
from fenics_contact.errors import InvalidInputError

if TYPE_CHECKING:
    from fenics_contact._pairing.sliding.means import MovingMeans

Known: TypeAlias = ContactPoints | LastPoints


@dataclass(frozen=True)
class Moved:
    """Where the bodies lie now, and what is known of their points before.

    Attributes:
        coordinates: Coordinates of the nodes of all bodies, shape (n_nodes, dim), [length].
        last: Points of nearby coordinates; none at first.
        start: Where nodes were at the start of the step; none at first.
        free_tools: Names of masters with free components, whose points need derivatives by their motion.
        reach: Distance beyond which nodes need no point, [length].
    """

    scene: Scene
    coordinates: np.ndarray
    placements: Placements
    last: Known
    start: MaterialPoints
    free_tools: frozenset[str]
    reach: float
    comm: MPI.Comm


@dataclass(frozen=True)
class Found:
    """The points of one pair, what derivatives of them need, nodes without one, and mortar by its number."""

    points: ContactPoints
    differential: Differential
    lost: np.ndarray = field(default_factory=lambda: np.zeros(0, dtype=np.int64))
    means: Mapping[int, MovingMeans] = field(default_factory=dict)


@dataclass(frozen=True)
class Candidates:
    """The slave of a contact pair.

    Attributes:
        number: Which of the pairs of the scene.
        slave: The slave surface in the reference configuration.
        slave_nodes: Its nodes among those of all bodies, shape (n_slave,).
        candidates: Positions in them of the nodes that may carry a multiplier, shape (n_candidates,).
        offset: What is added to the gap of each of them, as the pair gives it, shape (n_candidates,),
            [length].
        given: Whether it is, shape (n_candidates,).
        area: Area that belongs to each of them, shape (n_candidates,), [length^(dim - 1)].
        own: Weights of the slave's nodes in where candidates lie, at their nodes at first, shape
            (n_candidates, n_slave).
        on_facet: The facet of the slave in which one lies, −1 at nodes, shape (n_candidates,).
        on_local: Local coordinates on it, shape (n_candidates, dim − 1).
        merged_nodes: Whose areas they have, too, see `ContactPoints.merged_nodes`.
    """

    number: int
    slave: FacetedSurface
    slave_nodes: np.ndarray
    candidates: np.ndarray
    offset: np.ndarray
    given: np.ndarray
    area: np.ndarray
    own: sp.csr_matrix
    on_facet: np.ndarray
    on_local: np.ndarray
    merged_nodes: sp.csr_matrix

    @property
    def nodes(self) -> np.ndarray:
        """Nodes that may carry a multiplier among those of all bodies, ascending, shape (n_candidates,)."""
        return np.asarray(self.slave_nodes[self.candidates])

    def part(self, chosen: np.ndarray) -> Self:
        """Return the pair with some of its candidates, by their positions; not of a body with itself."""
        names = ("candidates", "offset", "given", "area", "own", "on_facet", "on_local", "merged_nodes")
        return replace(self, **{name: getattr(self, name)[chosen] for name in names})

    def normals(self, coordinates: np.ndarray) -> np.ndarray:
        """Return the outward normals of the candidates as the bodies lie now, shape (n_candidates, dim)."""
        return np.asarray(self.own @ moved_surface(self.slave, coordinates[self.slave_nodes]).averaged)

    def with_inside(self, inside: InsideOf, places: InFacets) -> Self:
        """Return the pair with some candidates, by their nodes, inside facets of the slave."""
        at, own = np.searchsorted(self.nodes, places.point), self.own.tolil()
        offset, on_facet, on_local = self.offset.copy(), self.on_facet.copy(), self.on_local.copy()
        own[at] = inside.at(places.facet, places.local).own[:, self.slave_nodes]
        offset[at] += places.relief
        on_facet[at], on_local[at] = places.facet, places.local
        return replace(self, offset=offset, own=own.tocsr(), on_facet=on_facet, on_local=on_local)

    @property
    def cut(self) -> np.ndarray:
        """Planes of symmetry that cut the slave at candidates, shape (n_candidates, n_planes)."""
        return np.asarray(abs(self.own) @ (~self.slave.mirrored).astype(float) < ON_PLANE)

    def points(
        self, chosen: np.ndarray, normal: np.ndarray, distance: np.ndarray, weights: sp.csr_matrix
    ) -> ContactPoints:
        """Return points at candidates, without facets."""
        pair, gap, facet = np.full(len(chosen), self.number), distance + self.offset[chosen], self.on_facet
        points = ContactPoints.at_nodes(
            pair, self.nodes[chosen], weights, normal, gap, self.area[chosen], distance=distance,
            given=self.given[chosen], merged_nodes=self.merged_nodes[chosen],
        )  # fmt: skip
        if (facet < 0).all():
            return points
        own = self.own[chosen]
        own = Csr((own.data, self.slave_nodes[own.indices], own.indptr), shape=weights.shape)
        return replace(points, own=own, slave_facet=facet[chosen], slave_local=self.on_local[chosen])

    def joined_to(self, lost: np.ndarray, kept: np.ndarray) -> Self:
        """Return the pair without some of its nodes, whose areas others have."""
        there = np.flatnonzero(np.isin(self.nodes, lost))
        if not len(there):
            return self
        order = np.argsort(lost)
        place = np.searchsorted(self.nodes, kept[order])
        area = self.area.copy()
        np.add.at(area, place, self.area[there])
        entries = self.nodes[there] + 1, (place, np.full(len(place), self.number))
        merged_nodes = self.merged_nodes.maximum(Csr(entries, shape=self.merged_nodes.shape))
        return replace(self, area=area, merged_nodes=merged_nodes).part(
            np.setdiff1d(np.arange(len(area)), there)
        )


@dataclass(frozen=True)
class SlidingPair(Candidates, ABC):
    """A contact pair: its slave and, of each kind, its counterpart."""

    master: Any

    @classmethod
    @abstractmethod
    def serves(cls, pair: ContactPair) -> bool:
        """Return whether the counterpart of a pair is of this kind, if it is of none before."""

    @classmethod
    def of(cls, scene: Scene, pair: ContactPair, side: Candidates, master: Any) -> SlidingPair:
        """Return the slave of a pair with its master."""
        return cls(**vars(side), master=master)

    @abstractmethod
    def at(self, moved: Moved) -> Found:
        """Return the points where the bodies lie now. Collective."""


def require_inside(scene: Scene) -> None:
    """Reject masters that end at a side of a sector: nodes that slide over it would meet the neighbour's."""
    for sector in scene.sectors:
        for pair in scene.contacts:
            for side, master in product(sector.surfaces, pair.surfaces[1:]):
                if master.body != side.body:
                    continue
                surfaces = scene.bodies[side.body].mesh.surfaces
                if np.isin(surfaces[master.name], surfaces[side.name]).any():
                    raise InvalidInputError(
                        "contact of bodies that deform much does not go on around a sector, but the master "
                        f"of {pair.place} ends at the side {side.name!r} of {sector.place}: model the whole, "
                        "let the master end before, or take a rigid obstacle as master"
                    )


def joined_once(
    meetings: tuple[SlidingPair, ...], scene: Scene, points: ContactPoints, ties: ContactPoints
) -> tuple[SlidingPair, ...]:
    """Return the pairs with one of two candidates where both move alike: around sectors, and at sections.

    `points`, `ties`: those of undeformed bodies.
    """
    if scene.sectors and scene.contacts:
        from fenics_contact._pairing.sectors import around_once

        lost, onto = around_once(points, ties, scene)
        kept = np.asarray(onto.argmax(axis=1)).ravel()
        mine = [points.pair[lost] == met.number for met in meetings]
        meetings = tuple(
            met.joined_to(points.slave[lost[own]], points.slave[kept[own]])
            for met, own in zip(meetings, mine, strict=True)
        )
    return tuple(_once_at_sections(scene, met) for met in meetings)


def _once_at_sections(scene: Scene, meeting: SlidingPair, across: float = 0.1) -> SlidingPair:
    """Return a pair by nodes with one of two candidates on both sides of a section, see `once_at_sections`.

    `across`: largest cosine between normals of contact and section with which they count as across.
    """
    pair, numbers = scene.contacts[meeting.number], NodeNumbers.of(scene)
    for preload in scene.preloads:
        if pair.by_mortar or pair.slave.body != preload.body:
            continue
        mesh = scene.bodies[preload.body].mesh
        behind, before = numbers.global_nodes(preload.body, preload.cut(mesh).pairs).T
        along = np.abs(meeting.slave.normals[meeting.candidates] @ preload.normal(mesh)) < across
        both = np.isin(behind, meeting.nodes[along]) & np.isin(before, meeting.nodes[along])
        meeting = meeting.joined_to(behind[both], before[both])
    return meeting


def shared_once(meetings: tuple[SlidingPair, ...], scene: Scene) -> tuple[SlidingPair, ...]:
    """Return the pairs, of which each node that meets the same by nodes has points of the first only.

    Wherever the bodies lie, such nodes have the same counterpart in both pairs: the split of their force
    would not be determined. They keep the area of both surfaces. By mortar the counterparts are means over
    different facets, and of other masters a node may leave one for the other: these points are left alone.
    """
    pairs, result = scene.contacts, list(meetings)
    for other, pair in enumerate(pairs):
        for one in range(other):
            if _have_same_rows(pairs[one], pair):
                beside = are_beside(scene, pairs[one], pair)
                result[one], result[other] = _split(result[one], result[other], beside)
    return tuple(result)


def _have_same_rows(pair: ContactPair, other: ContactPair) -> bool:
    """Return whether a node has the same counterpart and gap in both pairs."""
    one, two = pair.master, other.master
    same = one is two or (isinstance(one, (Surface, RigidPlane)) and one == two)
    given = (pair.gap, pair.interference, pair.adjust) == (other.gap, other.interference, other.adjust)
    by_mortar = pair.by_mortar or other.by_mortar
    return same and given and not by_mortar and not pair.is_self_contact and pair.geometry == other.geometry


def _split(kept: SlidingPair, lost: SlidingPair, beside: bool) -> tuple[SlidingPair, SlidingPair]:
    """Return two pairs, the second without the nodes that both have where their surfaces run on smoothly."""
    _, here, there = np.intersect1d(kept.nodes, lost.nodes, return_indices=True)
    normals = kept.slave.normals[kept.candidates[here]], lost.slave.normals[lost.candidates[there]]
    parallel = np.einsum("nd,nd->n", *normals) > PARALLEL
    here, there = here[parallel], there[parallel]
    stays = np.setdiff1d(np.arange(len(lost.candidates)), there)
    if beside:
        area = kept.area.copy()
        area[here] += lost.area[there]
        entries = lost.nodes[there] + 1, (here, np.full(len(here), lost.number))
        merged_nodes = kept.merged_nodes + Csr(entries, shape=kept.merged_nodes.shape)
        kept = replace(kept, area=area, merged_nodes=merged_nodes.tocsr())
    return kept, lost.part(stays)
