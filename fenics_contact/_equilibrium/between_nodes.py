"""Contact that a state misses between the nodes of its slaves."""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np

from fenics_contact._pairing.inside import Deepest, InsideOf, PointsInside, deepest_points
from fenics_contact._scene.pairs import Surface
from fenics_contact._surfaces.facets import corner_places
from fenics_contact.errors import together
from fenics_contact.feti.averages import nodal_mean_at
from fenics_contact.results.deformed_state import DeformedState
from fenics_contact.results.resolution import BetweenNodes
from fenics_contact.results.state import State

#: Depths below nodes up to this share of what moves are those of meshes that are fine enough.
SHARE = 0.1
#: The same where nothing presses at nodes: a contact that would be missed as a whole.
ALONE = 0.01


@dataclass(frozen=True, eq=False)
class Missed:
    """What one pair of a state misses: facets that lie deeper in the master than their nodes.

    Attributes:
        number: Of the pair.
        deepest: The deepest points of these facets.
        points: What they meet, undeformed where displacements are small.
        places: Where they are, shape (n, dim), [length].
        moved: How far surfaces move against each other, [length].
    """

    number: int
    deepest: Deepest
    points: PointsInside
    places: np.ndarray
    moved: float

    def doubt(self, place: str) -> BetweenNodes:
        """Return what to say of it."""
        at = int(np.argmax(self.deepest.missed))
        where = tuple(map(float, self.places[at]))
        return BetweenNodes(place, float(self.deepest.missed[at]), self.moved, where)


def between_nodes(state: State, number: int, moved: float | None = None) -> Missed | None:
    """Return what a pair misses between its nodes by more than a share of what moves. Collective.

    None where it misses nothing, and where its gaps are given.

    `moved`: how far its surfaces move against each other, [length]; None: as the deepest facets do.
    """
    scene, comm = state.scene, state.torn.decomposition.comm
    pair = scene.contacts[number]
    if pair.within_body or pair.nodes is not None or pair.given_gap:
        return None
    presses = bool(state.contact.normal_force[state.contact.on_pair(number)].any())
    found: Missed | None = None
    with together(comm):
        undeformed = inside = InsideOf.of(scene, pair)
        if scene.deforms_much:
            inside = _where_it_is(state, inside, number)
        # Round bodies on facets of each other are as far apart as these are from what they stand for.
        known = not (scene.deforms_much and presses and isinstance(pair.master, Surface))
        facets = _near(state, inside, number) if known else np.zeros(0, dtype=np.int64)
    displaced = _displaced(state, inside, facets)
    with together(comm):
        if comm.rank == 0 and len(facets):
            found = _deepest(inside, undeformed, number, facets, displaced)
            least = SHARE if presses else ALONE
            if found is not None:
                found = replace(found, moved=found.moved if moved is None else moved)
                if found.deepest.missed.max() <= least * found.moved:
                    found = None
    return comm.bcast(found)


def _where_it_is(state: State, inside: InsideOf, number: int) -> InsideOf:
    assert isinstance(state, DeformedState)
    points = state.equilibrium.evaluation.contact.points
    assert points is not None
    return inside.moved(points.coordinates, points.placements[number])


def _deepest(
    inside: InsideOf, undeformed: InsideOf, number: int, facets: np.ndarray, displaced: np.ndarray
) -> Missed | None:
    def gaps_at(facet: np.ndarray, local: np.ndarray) -> np.ndarray:
        return inside.at(facet, local).gap(displaced)

    deepest = deepest_points(inside.slave.corners, facets, gaps_at)
    if not len(deepest.facet):
        return None
    points = inside.at(deepest.facet, deepest.local)
    places = points.own[:, inside.nodes] @ inside.slave.points
    ends = corner_places(inside.slave.corners)
    local = np.concatenate([deepest.local, np.tile(ends, (len(deepest.facet), 1))])
    every = np.concatenate([deepest.facet, np.repeat(deepest.facet, len(ends))]), local
    before, after = undeformed.at(*every).distance, gaps_at(*every)
    met = np.isfinite(before) & np.isfinite(after)
    closed = float(np.abs(before[met] - after[met]).max(initial=0.0))
    return Missed(number, deepest, points, places, closed)


def _near(state: State, inside: InsideOf, number: int) -> np.ndarray:
    """Return the facets inside which the gap may be smaller than at their nodes."""
    contact, slave = state.contact, inside.slave
    mine = contact.on_pair(number)
    place = np.searchsorted(inside.nodes, contact.points.slave[mine])
    gap = np.full(len(inside.nodes), np.inf)
    gap[place] = contact.gap[mine]
    lowest = gap[slave.facets].min(axis=1)
    if inside.master is None:  # its features may be finer than cells
        return np.flatnonzero(lowest <= inside.sizes)
    assert isinstance(inside.pair.master, Surface)
    every = np.zeros((inside.numbers.n_nodes, inside.scene.dim))
    every[inside.numbers.global_nodes(inside.pair.master.body, inside.master.nodes)] = inside.master.normals
    normals = np.full(slave.points.shape, np.nan)
    normals[place] = contact.points.master[mine] @ every
    # A parabola that turns by an angle over its width is an eighth of the product deep, twice in space.
    deep = 0.5 * inside.sizes * inside.turning(normals)
    return np.flatnonzero(lowest <= deep)


def _displaced(state: State, inside: InsideOf, facets: np.ndarray) -> np.ndarray:
    """Return the displacements of the nodes of both bodies of a pair, (n_nodes, dim). Collective.

    Zero at other nodes, and where bodies are measured where they are.
    """
    scene, decomposition = state.scene, state.torn.decomposition
    displaced = np.zeros((decomposition.tearing.n_nodes, scene.dim))
    if not len(facets) or scene.deforms_much:
        return displaced
    master = inside.pair.master
    other = master.body if isinstance(master, Surface) else getattr(master, "name", "")
    for name in {inside.pair.slave.body, other} & set(scene.bodies):
        nodes = inside.numbers.global_nodes(name, np.arange(scene.bodies[name].mesh.n_nodes))
        displaced[nodes] = nodal_mean_at(decomposition, state.torn_displacement, nodes)[:, : scene.dim]
    return displaced
