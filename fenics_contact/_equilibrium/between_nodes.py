"""Contact that a state misses between the nodes of its slaves."""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import TYPE_CHECKING, cast

import numpy as np
from scipy.spatial import cKDTree

from fenics_contact._base.sparse import LAST_PLACES
from fenics_contact._pairing.inside import (
    FLAT,
    Deepest,
    GapsAt,
    InFacets,
    InsideOf,
    PointsInside,
    Sampled,
    deepest_points,
    points_inside,
)
from fenics_contact._pairing.points import ContactPoints, NodeNumbers
from fenics_contact._scene.pairs import ContactPair, Surface
from fenics_contact._surfaces.facets import corner_places, edge_distance
from fenics_contact.errors import together
from fenics_contact.feti.averages import nodal_mean_at
from fenics_contact.feti.torn import TornSystem, with_points
from fenics_contact.results.contact import ContactResult
from fenics_contact.results.linear_state import LinearState
from fenics_contact.results.resolution import BetweenNodes
from fenics_contact.results.state import State

if TYPE_CHECKING:
    from fenics_contact.results.deformed_state import DeformedState

#: Depths below nodes up to this share of what moves are those of meshes that are fine enough.
SHARE = 0.1
#: The same where nothing presses at nodes: a contact that would be missed as a whole.
ALONE = 0.01
#: Local coordinates nearer to the edge of a facet than this may belong to its neighbours.
EDGE = 0.02
#: Part of what lies deeper inside a facet than its nodes that does not press. The nodes of a facet are
#: stiffer than the spot that they stand for: forces are nearest to Hertz's with two thirds.
RELIEF = 2.0 / 3.0
#: Part of the whole depth that must be left beyond that, where a node is open and where all press: they
#: press in then by less than a third and a sixth of what they miss. Where nodes find more of a contact, its
#: pressures are better without.
LEFT, LEFT_CLOSED = 0.1, 0.2
#: Reliefs that are as near to those of their forces as this are kept.
ENOUGH = 0.8
#: Divisors are no smaller.
TINY = float(np.finfo(float).tiny)


@dataclass(frozen=True, eq=False)
class Missed:
    """What one pair of a state misses: facets that lie deeper in the master than their nodes.

    `deepest`: the deepest points of these facets; `points`: what they meet, undeformed where displacements
    are small; `bulge`: by how much gaps are smaller than those between nodes; `pressed_in`: how far they are
    pressed in compared with nodes around; `near`: distances below which points of different facets are the
    same.
    """

    number: int
    deepest: Deepest
    points: PointsInside
    bulge: np.ndarray
    pressed_in: np.ndarray
    facets: np.ndarray
    near: np.ndarray
    places: np.ndarray
    moved: float

    def doubt(self, place: str) -> BetweenNodes:
        """Return what to say of it."""
        at = int(np.argmax(self.deepest.missed))
        where = tuple(map(float, self.places[at]))
        return BetweenNodes(place, float(self.deepest.missed[at]), self.moved, where)


def between_nodes(state: State, number: int, moved: float = 0.0) -> Missed | None:
    """Return what a pair misses between its nodes by more than a share of what moves. Collective.

    None where it misses nothing, and where its gaps are given. It is looked for once in a state, and deepest
    points only where samples show that it may be more than a share of what is known to move.
    """
    pressing = _pressing_points(state, number)
    found, below = state.missed.get(number, (None, np.inf))
    if (least := least_depth(moved, pressing)) < below:
        found, below = state.missed[number] = _missed(state, number, least)
    missed = cast("Missed | None", found)
    if missed is None:
        return None
    missed = replace(missed, moved=max(missed.moved, moved))
    return missed if missed.deepest.missed.max() > least_depth(missed.moved, pressing) else None


def _missed(state: State, number: int, least: float) -> tuple[Missed | None, float]:
    """Return where facets of a pair lie deeper than their nodes, None where none does. Collective.

    And 0, or the least depth where samples show that no facet lies so much deeper.
    """
    scene, comm = state.scene, state.torn.decomposition.comm
    pair = scene.contacts[number]
    if not can_miss(pair):
        return None, 0.0
    found: tuple[Missed | None, float] = None, 0.0
    with together(comm):
        undeformed = InsideOf.of(scene, pair)
        inside = where_they_are(state, undeformed, number)
        # Round bodies on facets of each other are as far apart as these are from what they stand for.
        bodies = isinstance(pair.master, Surface)
        known = not (scene.deforms_much and _presses(state, number) and bodies)
        facets = _near(state, inside, number) if known else np.zeros(0, dtype=np.int64)
    facets = comm.bcast(facets)
    displaced = _displaced(state, inside, facets)
    with together(comm):
        mine = facets[comm.rank :: comm.size]
        parts = [Sampled.of(inside.slave.corners, mine, _gaps(inside, displaced))] if len(mine) else []
    parts = [part for some in comm.allgather(parts) for part in some]
    with together(comm):
        if comm.rank == 0 and len(facets):
            sampled, found = Sampled.join(parts), (None, least)
            if len(sampled.may_miss(least)):
                found = _deepest(inside, undeformed, number, sampled, displaced), 0.0
    return comm.bcast(found)


def can_miss(pair: ContactPair) -> bool:
    """Return whether a pair may miss contact between nodes, whose gaps and nodes are not given."""
    return not (pair.is_self_contact or pair.nodes is not None or pair.given_gap)


def _presses(state: State, number: int) -> bool:
    return bool(state.contact.normal_force[state.contact.on_pair(number)].any())


def more_press_than_a_facet_has(state: State, number: int) -> bool:
    """Return whether more points of a pair press than a facet has corners: most of the force is found."""
    return _pressing_points(state, number) > 2 ** (state.scene.dim - 1)


def _pressing_points(state: State, number: int) -> int:
    return int(np.count_nonzero(state.contact.normal_force[state.contact.on_pair(number)] > 0.0))


def least_depth(moved: float, pressing: int) -> float:
    """Return the depth up to which nothing is missed where so many points press and surfaces move so far."""
    return (SHARE if pressing else ALONE) * moved


def where_they_are(state: State, undeformed: InsideOf, number: int) -> InsideOf:
    """Return the surfaces of a pair where a state has them, undeformed where displacements are small."""
    if not state.scene.deforms_much:
        return undeformed
    return cast("DeformedState", state).equilibrium.evaluation.contact.where_they_are(undeformed, number)


def displaced_at(state: State, nodes: np.ndarray) -> np.ndarray:
    """Return the displacements of nodes, zero at others, shape (n_nodes, dim), [length]. Collective."""
    decomposition, dim = state.torn.decomposition, state.scene.dim
    displaced = np.zeros((decomposition.tearing.n_nodes, dim))
    displaced[nodes] = nodal_mean_at(decomposition, state.torn_displacement, nodes)[:, :dim]
    return displaced


def _deepest(
    inside: InsideOf, undeformed: InsideOf, number: int, sampled: Sampled, displaced: np.ndarray
) -> Missed | None:
    gaps_at = _gaps(inside, displaced)
    rounding = LAST_PLACES * float(np.abs(inside.slave.points).max())
    deepest = deepest_points(inside.slave.corners, sampled, gaps_at, rounding)
    if not len(deepest.facet):
        return None
    points = inside.at(deepest.facet, deepest.local)
    places = points.own[:, inside.nodes] @ inside.slave.points
    ends = corner_places(inside.slave.corners)
    local = np.concatenate([deepest.local, np.tile(ends, (len(deepest.facet), 1))])
    every = np.concatenate([deepest.facet, np.repeat(deepest.facet, len(ends))]), local
    opened_at = _opened(inside, undeformed, displaced)
    moved = np.abs(opened_at(*every))
    closed = float(moved[np.isfinite(moved)].max(initial=0.0))
    pressed_in = inside.pressed_in(deepest.facet, deepest.local, opened_at)
    bulge = inside.bulge(deepest.facet, deepest.local, gaps_at)
    facets, near = inside.slave.facets[deepest.facet], EDGE * inside.sizes[deepest.facet]
    return Missed(number, deepest, points, bulge, pressed_in, facets, near, places, closed)


def _near(state: State, inside: InsideOf, number: int) -> np.ndarray:
    """Return the facets inside which the gap may be smaller than at their nodes."""
    contact, slave = state.contact, inside.slave
    mine = contact.on_pair(number)
    place = np.searchsorted(inside.nodes, contact.points.slave[mine])
    gap = np.full(len(inside.nodes), np.inf)
    gap[place] = contact.gap[mine]
    lowest = gap[slave.facets].min(axis=1)
    # A parabola that turns by an angle over its width is an eighth of the product deep, twice in space.
    deep = 0.5 * inside.sizes * inside.master.turning(slave, place, contact.points.master[mine])
    return np.flatnonzero(lowest <= deep)


def _displaced(state: State, inside: InsideOf, facets: np.ndarray) -> np.ndarray:
    """Return the displacements of the nodes of both bodies of a pair, (n_nodes, dim). Collective.

    Zero at other nodes, and where bodies are measured where they are.
    """
    nodes, numbers = [np.zeros(0, dtype=np.int64)], NodeNumbers.of(state.scene)
    if len(facets) and not state.scene.deforms_much:
        for name in {inside.master.pair.slave.body} | inside.master.bodies:
            count = state.scene.bodies[name].mesh.n_nodes
            nodes.append(numbers.global_nodes(name, np.arange(count)))
    return displaced_at(state, np.unique(np.concatenate(nodes)))


def with_places(torn: TornSystem, places: InFacets) -> TornSystem:
    """Return a system whose points are at nodes with some of them inside facets. Collective."""
    decomposition = torn.decomposition
    with together(decomposition.comm):
        points = points_inside(torn.scene, torn.points, places, decomposition.fixed, decomposition.axes)
    return with_points(torn, points)


class InsideFacets:
    """Points of a system that go inside facets of its slaves, where a state misses contact.

    Such a point stands for a node of its facet, whose row it takes: constraints stay as many as they are.
    That is an open node, else the one that presses least; if it lies in the master then, its row comes back.
    """

    def __init__(self, dim: int, *, on_the_way: bool = False) -> None:
        """Start with all points at their nodes.

        `on_the_way`: whether bodies are in a later load step, where points decide which way they go on.
        """
        self._stay, self._on_the_way = InFacets.none(dim), on_the_way

    def after(self, state: State, needed_nodes: np.ndarray) -> InFacets | None:
        """Return other places than those of a state, None where it misses nothing more. Collective.

        `needed_nodes`: points inside facets whose nodes now lie in the master.
        """
        points, known = state.contact.points, InFacets.of(state.contact.points)
        needed = np.isin(known.point, needed_nodes)
        self._stay = InFacets.join([self._stay, known.part(needed).by_key(points)])
        kept, busy = known.part(~needed), np.zeros(points.count, dtype=bool)
        busy[self._stay.by_number(points).point] = True
        found = [replace(kept, relief=_relieved(state, kept))]
        busy[known.point] = True
        for number in range(len(state.scene.contacts)):
            if self._is_found(state, number):
                continue
            missed = between_nodes(state, number)
            if missed is not None:
                found.append(_pressing(state, missed, busy))
        places = InFacets.join(found)
        if len(places.point) == len(known.point) and np.array_equal(places.relief, known.relief):
            return None
        return places

    def _is_found(self, state: State, number: int) -> bool:
        """Return whether nodes find a contact: where more of them press than a facet has, facets do not.

        Between two bodies, and on the way, one node or mean is enough. Nonlinear bodies have points on each
        other at nodes.
        """
        on_obstacle = not isinstance(state.scene.contacts[number].master, Surface)
        by_few = on_obstacle and not self._on_the_way
        found = more_press_than_a_facet_has(state, number) if by_few else _pressing_points(state, number) > 0
        return found or not (on_obstacle or isinstance(state, LinearState))


def _pressing(state: State, missed: Missed, busy: np.ndarray) -> InFacets:
    """Return points inside facets that a pair misses; marks them as `busy`, shape (n_points,)."""
    contact, points = state.contact, state.contact.points
    least = least_depth(missed.moved, _pressing_points(state, missed.number))
    depth = missed.deepest.missed
    total = depth + missed.pressed_in
    relief = RELIEF * np.minimum(missed.bulge, total)
    known = InFacets.of(points)
    has = known.facet[points.pair[known.point] == missed.number]
    excess = np.where(np.isin(missed.deepest.facet, has), 0.0, depth - relief)
    entries = _apart(missed, (excess > LEFT * total) & (depth > least))
    which = _free_points(missed, entries, contact, busy, excess[entries] > LEFT_CLOSED * total[entries])
    entries, which = entries[which >= 0], which[which >= 0]
    busy[which] = True
    return InFacets(which, missed.deepest.facet[entries], missed.deepest.local[entries], relief[entries])


def _relieved(state: State, kept: InFacets) -> np.ndarray:
    """Return the reliefs of points inside facets that belong to their forces, (k,), [length]. Collective.

    A force that presses its point in by c belongs to RELIEF / (1 − RELIEF) c. Where bodies give way, a point
    begins with more; between it and the relief at which it has no force, c is linear. In a load step that
    presses further a point that it began with has as much as one that is new.
    """
    points, comm = state.contact.points, state.torn.decomposition.comm
    (pressed_in, bulge), wanted = np.zeros((2, len(kept.point))), RELIEF / (1.0 - RELIEF)
    for number in np.unique(points.pair[kept.point]):
        mine = np.flatnonzero(points.pair[kept.point] == number)
        undeformed = InsideOf.of(state.scene, state.scene.contacts[int(number)])
        inside = where_they_are(state, undeformed, int(number))
        displaced = _displaced(state, inside, mine)
        at = kept.facet[mine], kept.local[mine]
        with together(comm):
            pressed_in[mine] = inside.pressed_in(*at, _opened(inside, undeformed, displaced))
            bulge[mine] = inside.bulge(*at, _gaps(inside, displaced))
    pressed_in, bulge = comm.bcast((pressed_in, bulge))
    open_ = kept.relief / RELIEF
    new = wanted * pressed_in * open_ / np.maximum(open_ - kept.relief + wanted * pressed_in, TINY)
    new = np.where(new < ENOUGH * kept.relief, new, kept.relief)
    further = RELIEF * np.minimum(bulge, kept.relief + pressed_in)
    return np.where(kept.relief < ENOUGH * further, further, new)


def _gaps(inside: InsideOf, displaced: np.ndarray) -> GapsAt:
    """Return the gaps at points of facets."""

    def gaps_at(facet: np.ndarray, local: np.ndarray) -> np.ndarray:
        return inside.at(facet, local).gap(displaced)

    return gaps_at


def _opened(inside: InsideOf, undeformed: InsideOf, displaced: np.ndarray) -> GapsAt:
    """Return by how much gaps have opened at points of facets, not finite where these do not meet."""

    def opened_at(facet: np.ndarray, local: np.ndarray) -> np.ndarray:
        after, before = inside.at(facet, local).gap(displaced), undeformed.at(facet, local).distance
        met = np.isfinite(after) & np.isfinite(before)
        return np.where(met, np.where(met, after, 0.0) - np.where(met, before, 0.0), np.inf)

    return opened_at


def needed_nodes_on_obstacles(state: State) -> np.ndarray:
    """Return the points inside facets whose nodes now lie in an obstacle, shape (k,). Collective."""
    points, needed = state.contact.points, [np.zeros(0, dtype=np.int64)]
    which = points.are_inside
    for number in np.unique(points.pair[which]):
        mine = which[points.pair[which] == number]
        undeformed = InsideOf.of(state.scene, state.scene.contacts[int(number)])
        inside = where_they_are(state, undeformed, int(number))
        displaced = _displaced(state, inside, mine)
        at = inside.at_nodes(np.searchsorted(inside.nodes, points.slave[mine]))
        gap, before = inside.at(*at).gap(displaced), undeformed.at(*at).distance
        met = np.isfinite(gap) & np.isfinite(before)
        mine, gap, before = mine[met], gap[met], before[met]
        needed.append(mine[gap < -SHARE * np.abs(gap - before)])
    return np.concatenate(needed)


def needed_nodes(state: State, at_nodes: ContactPoints) -> np.ndarray:
    """Return the points inside facets whose nodes now lie in the master, shape (k,). Collective."""
    points = state.contact.points
    which = points.are_inside
    if not len(which):
        return which
    own = at_nodes.part(which)
    nodes = np.flatnonzero(np.diff(own.jump.tocsc().indptr))
    displaced = displaced_at(state, nodes)
    closing = np.einsum("nd,nd->n", own.normal, own.relative(displaced))
    gap = own.gap + closing
    return np.asarray(which[gap < -SHARE * np.abs(closing)])


def _apart(missed: Missed, chosen: np.ndarray) -> np.ndarray:
    """Return those of the chosen entries that miss most among their neighbours, deepest first."""
    deepest, facets, depth = missed.deepest, missed.facets, missed.deepest.missed
    order = np.lexsort((deepest.facet, -np.round(depth / depth.max(), 6)))
    at_nodes = np.zeros(facets.max(initial=-1) + 1)
    np.maximum.at(at_nodes, facets.ravel(), np.repeat(depth, facets.shape[1]))
    deeper = at_nodes[facets].max(axis=1) > (1.0 + FLAT) * depth
    at_edge = edge_distance(deepest.local, facets.shape[1]) < EDGE
    order = order[(chosen & ~(at_edge & deeper))[order]]
    places, near = missed.places[order], missed.near[order]
    one, other = cKDTree(places).query_pairs(near.max(initial=0.0), output_type="ndarray").T
    same = np.linalg.norm(places[one] - places[other], axis=1) <= near[other]
    return np.delete(order, np.unique(other[same]))


def _free_points(
    missed: Missed, entries: np.ndarray, contact: ContactResult, busy: np.ndarray, may_press: np.ndarray
) -> np.ndarray:
    """Return the points of nodes that ones inside facets can stand for, −1 where none can, shape (n,).

    Of open nodes the nearest one, else, where it `may_press`, shape (n,), the one that presses least. First
    entries choose first.
    """
    free = np.full(missed.points.own.shape[1], -1)
    mine = np.flatnonzero((contact.points.pair == missed.number) & ~busy)
    free[contact.points.slave[mine]] = mine
    weights = missed.points.own[entries].tocoo()
    entry, point, weight = weights.row, free[weights.col], np.round(weights.data, 6)
    force = np.where(point >= 0, contact.normal_force[point], np.inf)
    fits = (weights.data > 0.0) & (point >= 0) & (may_press[entry] | (force <= 0.0))
    order = np.flatnonzero(fits)[np.lexsort((point[fits], -weight[fits], force[fits], entry[fits]))]
    entry, point = entry[order], point[order]
    turn, last = np.searchsorted(entry, [np.arange(len(entries)), np.arange(1, len(entries) + 1)])
    while True:  # those whose point an earlier one has ask for their next one
        pending = np.flatnonzero(turn < last)
        first = np.unique(point[turn[pending]], return_index=True)[1]
        lost = np.delete(pending, first)
        if not len(lost):
            break
        turn[lost] += 1
    found = np.full(len(entries), -1)
    found[pending] = point[turn[pending]]
    return found
