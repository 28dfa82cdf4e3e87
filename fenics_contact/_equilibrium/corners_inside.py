"""Corners of a master that press between the nodes of its slave."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING, cast

import numpy as np

from fenics_contact._pairing.inside import InsideOf
from fenics_contact._scene.pairs import ContactPair, Surface
from fenics_contact._scene.parts import sharp_at
from fenics_contact._scene.scene import Scene
from fenics_contact._surfaces.facets import FacetedSurface
from fenics_contact._surfaces.projection import Projection, node_weights, project
from fenics_contact.errors import together
from fenics_contact.feti.averages import nodal_mean_at
from fenics_contact.mesh.faces import computed_rounding, vector_areas
from fenics_contact.results.resolution import CornerBetweenNodes
from fenics_contact.results.state import State

if TYPE_CHECKING:
    from fenics_contact.results.deformed_state import DeformedState

#: Depths of corners up to this share of what moves are those of meshes that are fine enough.
SHARE = 0.1
#: The same where nothing presses: a contact that would be missed as a whole.
ALONE = 0.01
#: Corners that were deeper inside than this many widths of a facet belong to another side of the slave.
WIDTHS = 0.5
#: Cosine of the angle up to which a face beside a corner lies flat on the slave, whose nodes find it. Facets
#: of round bodies, whose joints may look like edges where cells are large, are not steeper there.
FLAT = float(np.cos(np.radians(15.0)))


@dataclass(frozen=True, eq=False)
class _Corners:
    """Corners of a master that face its slave.

    Attributes:
        slave, master: The surfaces, where they are if bodies deform much.
        nodes: Nodes of slave and of master among those of all bodies.
        node: Position of each corner in the master, shape (n,).
        hit: Where they lie over the slave.
    """

    slave: FacetedSurface
    master: FacetedSurface
    nodes: tuple[np.ndarray, np.ndarray]
    node: np.ndarray
    hit: Projection

    @classmethod
    def of(cls, scene: Scene, pair: ContactPair, coordinates: np.ndarray | None) -> _Corners | None:
        """Find those of a pair, None without any. `coordinates`: of all nodes; None: undeformed."""
        assert isinstance(pair.master, Surface)
        sharp = np.flatnonzero(sharp_at(scene, pair.master))
        if not len(sharp):
            return None
        sides = InsideOf.of(scene, pair)
        if coordinates is not None:
            sides = sides.moved(coordinates, None)
        slave, master = sides.slave, sides.master
        assert master is not None
        nodes = sides.nodes, sides.numbers.global_nodes(pair.master.body, master.nodes)
        hit = project(master.points[sharp], master.normals[sharp], slave)
        hit = hit.part(~_lie_flat(master, sharp[hit.point], hit.normal))
        return cls(slave, master, nodes, sharp[hit.point], hit) if len(hit.point) else None

    def followed(self, moved: np.ndarray) -> np.ndarray:
        """Return how far corners move against the slave, from displacements of all nodes, (n, dim)."""
        own, other = self.nodes
        return np.asarray(moved[other[self.node]] - node_weights(self.slave, self.hit) @ moved[own])

    def at_nodes(self, gap: np.ndarray) -> np.ndarray:
        """Return the smallest gap at the nodes of their facets, at most zero, shape (n,)."""
        own, _ = self.nodes
        lowest: np.ndarray = gap[own[self.slave.facets[self.hit.facet]]].min(axis=1)
        return np.minimum(lowest, 0.0)

    @property
    def widths(self) -> np.ndarray:
        """Widths of their facets, shape (n,), [length]."""
        facets = self.slave.points[self.slave.facets[self.hit.facet]]
        return np.asarray(np.linalg.norm(np.ptp(facets, axis=1), axis=1))

    @property
    def needed(self) -> np.ndarray:
        """The nodes among those of all bodies that `followed` needs."""
        own, other = self.nodes
        facets = self.slave.facets[self.hit.facet] if self.slave.whole is None else self.slave.facets
        return np.union1d(own[facets.ravel()], other[self.node])


def corner_between_nodes(state: State, number: int) -> CornerBetweenNodes | None:
    """Return which corner of its master a pair misses by more than a share of what moves. Collective.

    None where it misses none, and where its gaps are given.
    """
    scene, decomposition = state.scene, state.torn.decomposition
    pair, comm = scene.contacts[number], state.torn.decomposition.comm
    if pair.within_body or pair.nodes is not None or pair.given_gap or not isinstance(pair.master, Surface):
        return None
    coordinates = None
    if scene.deforms_much:
        points = cast("DeformedState", state).equilibrium.evaluation.contact.points
        coordinates = None if points is None else points.coordinates
    with together(comm):
        corners = _Corners.of(scene, pair, coordinates)
    if corners is None:
        return None
    moved = np.zeros((decomposition.tearing.n_nodes, scene.dim))
    displacement = nodal_mean_at(decomposition, state.torn_displacement, corners.needed)
    moved[corners.needed] = displacement[:, : scene.dim]
    with together(comm):
        found = _deepest(state, number, corners, moved)
    return comm.bcast(found)


def _deepest(state: State, number: int, corners: _Corners, moved: np.ndarray) -> CornerBetweenNodes | None:
    scene, contact = state.scene, state.contact
    pair, hit = scene.contacts[number], corners.hit
    mine = contact.on_pair(number)
    closing = np.einsum("nd,nd->n", hit.normal, corners.followed(moved))
    before = hit.gap - closing if scene.deforms_much else hit.gap
    gap = np.where(before >= -WIDTHS * corners.widths, before + closing, np.inf)
    at_nodes = np.full(len(moved), np.inf)
    at_nodes[contact.points.slave[mine]] = contact.gap[mine]
    missed = np.maximum(corners.at_nodes(at_nodes) - gap, 0.0)
    at = int(np.argmax(missed))
    far = float(np.abs(closing[missed > 0.0]).max(initial=0.0))
    least = SHARE if contact.normal_force[mine].any() else ALONE
    if far <= computed_rounding(corners.slave.points) or missed[at] <= least * far:
        return None
    where = tuple(map(float, corners.master.points[corners.node[at]]))
    return CornerBetweenNodes(pair.place, float(missed[at]), far, where)


def _lie_flat(master: FacetedSurface, node: np.ndarray, normal: np.ndarray) -> np.ndarray:
    """Return which nodes of a master have a facet that lies flat on the slave, whose normals are given."""
    areas = vector_areas(master.points, master.facets)
    areas = areas / np.maximum(np.linalg.norm(areas, axis=1), np.finfo(float).tiny)[:, None]
    place = np.full(len(master.nodes), -1)
    place[node] = np.arange(len(node))
    facet, corner = np.nonzero(place[master.facets] >= 0)
    at = place[master.facets[facet, corner]]
    flat = np.zeros(len(node), dtype=bool)
    np.logical_or.at(flat, at, np.einsum("nd,nd->n", areas[facet], normal[at]) <= -FLAT)
    return flat

