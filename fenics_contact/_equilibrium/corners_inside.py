"""Corners of a master that press between the nodes of its slave, or are kept away from it."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from fenics_contact._equilibrium.between_nodes import can_miss, displaced_at, least_depth, where_they_are
from fenics_contact._pairing.inside import InsideOf
from fenics_contact._pairing.masters import BodyMaster
from fenics_contact._scene.pairs import Surface
from fenics_contact._scene.parts import sharp_at
from fenics_contact._surfaces.corners import corners_over
from fenics_contact._surfaces.facets import FacetedSurface, corner_places
from fenics_contact._surfaces.projection import Projection, node_weights
from fenics_contact.errors import together
from fenics_contact.mesh.faces import computed_rounding
from fenics_contact.results.resolution import BetweenNodes, CornerBetweenNodes, CornerKeptAway
from fenics_contact.results.state import State

#: Corners that were deeper inside than this many widths of a facet belong to another side of the slave.
WIDTHS = 0.5


@dataclass(frozen=True, eq=False)
class _Corners:
    """Corners of a master that face its slave.

    `sides`: the surfaces, where they are if bodies deform much; `node`: position of each corner in the
    master; `hit`: where they lie over the slave.
    """

    sides: InsideOf
    master: FacetedSurface
    nodes: tuple[np.ndarray, np.ndarray]
    node: np.ndarray
    hit: Projection

    @classmethod
    def of(cls, state: State, number: int) -> _Corners | None:
        """Find those of a pair where a state has them, None without any."""
        scene, pair = state.scene, state.scene.contacts[number]
        assert isinstance(pair.master, Surface)
        sharp = np.flatnonzero(sharp_at(scene, pair.master))
        if not len(sharp):
            return None
        sides = where_they_are(state, InsideOf.of(scene, pair), number)
        master = sides.master
        assert isinstance(master, BodyMaster)
        node, hit = corners_over(master.surface, sharp, sides.slave)
        return cls(sides, master.surface, (sides.nodes, master.nodes), node, hit) if len(node) else None

    def followed(self, moved: np.ndarray) -> np.ndarray:
        """Return how far corners move against the slave, from displacements of all nodes, (n, dim)."""
        own, other = self.nodes
        return np.asarray(moved[other[self.node]] - node_weights(self.sides.slave, self.hit) @ moved[own])

    def at_nodes(self, gap: np.ndarray) -> np.ndarray:
        """Return the smallest gap at the nodes of their facets, at most zero, shape (n,)."""
        return np.minimum(gap[self.below].min(axis=1), 0.0)

    def near(self, pressing: np.ndarray) -> np.ndarray:
        """Return which of them lie over facets of nodes that press, none where other nodes press as well."""
        found: np.ndarray = np.isin(self.below, pressing).any(axis=1)
        return found & np.isin(pressing, self.below[found]).all()

    def lowest_at(self, pressing: np.ndarray, moved: np.ndarray) -> float:
        """Return the smallest gap at the corners of the facets of nodes that press, [length]."""
        slave = self.sides.slave
        facet = np.flatnonzero(np.isin(self.nodes[0][slave.facets], pressing).any(axis=1))
        ends = corner_places(slave.corners)
        at = np.repeat(facet, len(ends)), np.tile(ends, (len(facet), 1))
        return float(self.sides.at(*at).gap(moved).min(initial=np.inf))

    @property
    def below(self) -> np.ndarray:
        """Nodes of the facets of the slave below them, shape (n, corners)."""
        return np.asarray(self.nodes[0][self.sides.slave.facets[self.hit.facet]])

    @property
    def widths(self) -> np.ndarray:
        """Widths of these facets, shape (n,), [length]."""
        return self.sides.sizes[self.hit.facet]


def corner_between_nodes(state: State, number: int) -> BetweenNodes | None:
    """Return which corner of its master a pair misses, or keeps away, by more than a share of what moves.

    Collective. None where there is none, and where its gaps are given.
    """
    pair, comm = state.scene.contacts[number], state.torn.decomposition.comm
    if not (can_miss(pair) and isinstance(pair.master, Surface)):
        return None
    with together(comm):
        corners = _Corners.of(state, number)
    if corners is None:
        return None
    moved = displaced_at(state, np.concatenate(corners.nodes))
    with together(comm):
        found = _doubt(state, number, corners, moved)
    return comm.bcast(found)


def _doubt(state: State, number: int, corners: _Corners, moved: np.ndarray) -> BetweenNodes | None:
    scene, contact, hit = state.scene, state.contact, corners.hit
    mine = contact.on_pair(number)
    closing = np.einsum("nd,nd->n", hit.normal, corners.followed(moved))
    before = hit.gap - closing if scene.deforms_much else hit.gap
    gap = np.where(before >= -WIDTHS * corners.widths, before + closing, np.inf)
    pressing = contact.points.slave[mine][contact.normal_force[mine] > 0.0]
    at_nodes = np.full(len(moved), np.inf)
    at_nodes[contact.points.slave[mine]] = contact.gap[mine]
    missed = np.maximum(corners.at_nodes(at_nodes) - gap, 0.0)
    kind: type[BetweenNodes] = CornerBetweenNodes
    near = corners.near(pressing) & np.isfinite(gap)
    if near.any() and not missed.any():
        kind = CornerKeptAway
        lowest = corners.lowest_at(pressing, np.zeros_like(moved) if scene.deforms_much else moved)
        nearest = gap[near].min()
        missed = np.where(near & (gap == nearest), max(min(nearest, lowest), 0.0), 0.0)
    at = int(np.argmax(missed))
    far = float(np.abs(closing[missed > 0.0]).max(initial=0.0))
    least = least_depth(far, len(pressing))
    if far <= computed_rounding(corners.sides.slave.points) or missed[at] <= least:
        return None
    where = tuple(map(float, corners.master.points[corners.node[at]]))
    return kind(scene.contacts[number].place, float(missed[at]), far, where)
