"""Contact points of a scene, by nodes and by mortar, with the gaps that pairs give."""

from __future__ import annotations

import logging
from dataclasses import replace
from functools import partial

import numpy as np

from fenics_contact._base.fingerprint import described, require_alike
from fenics_contact._base.libraries import MPI
from fenics_contact._pairing.advice import SILENCE, Advice
from fenics_contact._pairing.masters import Master, Search, Slave, master_of
from fenics_contact._pairing.points import ContactPoints, NodeNumbers, in_free_frames, join_points
from fenics_contact._pairing.tips import carrying
from fenics_contact._scene.local_axes import NO_AXES, LocalAxes
from fenics_contact._scene.pairs import ContactPair
from fenics_contact._scene.parts import may_touch, slave_of, surface_of
from fenics_contact._scene.scene import Scene
from fenics_contact._scene.sectors import AnyTie
from fenics_contact._scene.thickness import thickness_on
from fenics_contact._surfaces.facets import FacetedSurface
from fenics_contact.errors import InvalidDesignError, InvalidInputError, together
from fenics_contact.errors.kinds import safe_log
from fenics_contact.mesh.faces import computed_rounding

_LOG = logging.getLogger(__name__)


def with_given_gaps(
    points: ContactPoints, first: ContactPoints, pair: ContactPair, place: np.ndarray, comm: MPI.Comm
) -> ContactPoints:
    """Return points with the gaps that their pair gives. Collective on ``comm``.

    A given gap holds in the geometry that was given. Where a design has moved the surfaces since then, the
    change of their distance is added: g = g_given + d − d_first.

    `place`: coordinates of the slave nodes of ``first``, shape (n, dim), [length]; `comm`: communicator of
    the ranks; all have the same points.
    """
    with together(comm):
        _, now, then = np.intersect1d(points.slave, first.slave, return_indices=True)
        if len(now) < points.count:
            raise InvalidDesignError(
                "where a pair gives its gap, each slave node must face the master from the start, but "
                f"{points.count - len(now)} of {points.count} nodes do so only in this design: move the rim "
                "of the surfaces less, or leave the gap of the pair to measurement"
            )
        measured, place = first.distance[then], place[then]
        near = in_reach(pair, measured, place)
        if comm.rank == 0 and pair.adjust is not None:
            _tell_of_adjusted(pair, near, measured)
        wanted = pair.gap_at(place)
        target = np.where(near, 0.0 if wanted is None else wanted, measured)
    require_alike(comm, described(target, f"the gap given between {pair.place}"))
    moved = points.distance[now] - measured
    moved[np.abs(moved) <= computed_rounding(place)] = 0.0
    declared = near | (pair.interference == "measured")
    gap, given = points.gap.copy(), points.given.copy()
    gap[now], given[now] = target + moved, declared
    return replace(points, gap=gap, given=given)


def in_reach(pair: ContactPair, measured: np.ndarray, place: np.ndarray) -> np.ndarray:
    """Return at which points a pair replaces the gap, shape (n,).

    `measured`: distances of its slave nodes from the master, shape (n,), [length]; `place`: their
    coordinates, shape (n, dim), [length].
    """
    if pair.adjust is None:
        return np.full(len(measured), pair.gives_all_gaps)
    return np.abs(measured) <= pair.adjust + computed_rounding(place)


def _tell_of_adjusted(pair: ContactPair, near: np.ndarray, measured: np.ndarray) -> None:
    if near.any():
        log, words = (
            _LOG.info,
            "%d of %d points of %s lie within %g of the master and get the gap of the pair",
        )
        safe_log(log, words, np.count_nonzero(near), len(near), pair.place, pair.adjust)
        return
    safe_log(
        _LOG.warning,
        "no point of %s lies within adjust=%g of the master, the nearest has a distance of %.3g: nothing is "
        "put in touch; give a larger adjust, or move the bodies",
        pair.place, pair.adjust, measured[np.argmin(np.abs(measured))],
    )  # fmt: skip


def find_contact_points(
    scene: Scene,
    fixed: np.ndarray,
    comm: MPI.Comm | None = None,
    *,
    axes: LocalAxes = NO_AXES,
    finer: bool = False,
    advice: Advice = SILENCE,
) -> ContactPoints:
    """Find the contact points of every contact pair. Collective on ``comm``.

    Each rank searches a share of the nodes, and all receive all points. Nodes whose displacement is
    prescribed in all components cannot move and are omitted.

    `fixed`: whether a component of a node is prescribed, shape (n_nodes, dim), along its `axes`; `comm`:
    communicator of the ranks that share the work; this rank alone by default.
    """
    search, parts = Search(scene, fixed, axes, comm or MPI.COMM_SELF, finer, advice), []
    for number, pair in enumerate(scene.contacts):
        if pair.is_self_contact:
            continue  # no part of an undeformed body is near another one
        points = _measured(search, number, pair)
        if pair.given_gap:
            origin, mesh = scene.origin, scene.bodies[pair.slave.body].mesh.origin
            first = points
            if origin is not scene:
                first = _measured(replace(search, scene=origin, advice=SILENCE), number, pair)
            slave = first.slave - NodeNumbers.of(scene).first_of(pair.slave.body)
            points = with_given_gaps(points, first, pair, mesh.points[slave], search.comm)
        parts.append(_in_frames(points, search, pair))
    return join_points(parts, scene.components, len(fixed))


def find_tied_points(
    scene: Scene,
    fixed: np.ndarray,
    comm: MPI.Comm | None = None,
    *,
    axes: LocalAxes = NO_AXES,
    advice: Advice = SILENCE,
) -> ContactPoints:
    """Find the points of tied surfaces, as `find_contact_points`; ``pair`` numbers the ties. Collective."""
    search, parts = Search(scene, fixed, axes, comm or MPI.COMM_SELF, False, advice), []
    for number, tie in enumerate(scene.ties):
        slave = slave_of(scene, tie, tie.geometry)
        master = master_of(scene, tie, partial(surface_of, scene, geometry=tie.geometry))
        points = _faced(search, number, slave, master, np.ones(len(slave.nodes), dtype=bool))
        parts.append(_in_frames(points, search, tie))
    if scene.sectors:
        parts = [points.as_rotated() for points in parts]
    return join_points(parts, scene.components, len(fixed))


def without_rounding(gap: np.ndarray, points: np.ndarray) -> np.ndarray:
    """Return gaps, zero where surfaces touch up to the rounding of their coordinates.

    Otherwise bodies that only touch would be pressed apart by that rounding.

    `gap`: gaps, shape (n,), [length]; `points`: coordinates of one of the surfaces, shape (m, dim), [length].
    """
    return np.where(np.abs(gap) <= computed_rounding(points), 0.0, gap)


def _measured(search: Search, number: int, pair: ContactPair) -> ContactPoints:
    """Return the points of a contact pair with the gaps between its surfaces. Collective."""
    scene, finer = search.scene, search.finer
    slave = slave_of(scene, pair, pair.slave_geometry, finer=finer and pair.nodes is None)
    master = master_of(scene, pair, partial(surface_of, scene, geometry=pair.geometry, finer=finer))
    with together(search.comm):
        bearing = may_touch(scene.bodies, pair, slave) & carrying(pair, slave, master)
    return _faced(search, number, slave, master, bearing)


def _faced(
    search: Search, number: int, surface: FacetedSurface, master: Master, bearing: np.ndarray
) -> ContactPoints:
    """Return the points of a pair with the distances of its surfaces. Collective.

    `bearing`: which nodes of the slave may have a point as far as they can move, shape (n,).
    """
    scene, comm, pair, side = search.scene, search.comm, master.pair, master.pair.slave
    nodes = NodeNumbers.of(scene).global_nodes(side.body, surface.nodes)
    movable = ~search.fixed[nodes].all(axis=1) & master.movable(scene, nodes)
    search.advice.surface(scene, side, pair.geometry, surface, comm)
    points = master.points(
        Slave(number, len(scene.contacts), surface, nodes, movable, movable & bearing), search
    )
    if comm.rank == 0 and not movable.all():
        safe_log(
            _LOG.info,
            "%d of %d nodes of %s %d are left out as supports hold them in all directions",
            np.count_nonzero(~movable), len(movable), type(pair).__name__, number,
        )  # fmt: skip
    if points.count == 0:
        raise InvalidInputError(
            f"{type(pair).__name__} {number} needs slave nodes that face the master, but none of the "
            f"{np.count_nonzero(movable)} movable nodes of {side.name!r} meets it: "
            f"{master.cure_of_no_points(scene)}"
        )
    gap = without_rounding(points.gap, surface.points)
    points = replace(points, gap=gap, distance=gap)
    if not scene.has_hanging_nodes:
        return points
    from fenics_contact._pairing.following import on_masters

    return on_masters(points, scene, side.body, pair.discretisation == "mortar")


def _in_frames(points: ContactPoints, search: Search, pair: ContactPair | AnyTie) -> ContactPoints:
    """Return the points of a pair with areas by thickness, and the directions in which they may slip."""
    scene = search.scene
    if scene.has_thickness:
        thickness = thickness_on(scene.bodies[pair.slave.body], pair.slave.name, f"the slave of {pair.place}")
        points = replace(points, length=points.sizes, area=points.area * thickness)
    if not scene.torsion:
        return in_free_frames(points, search.fixed, search.axes)
    from fenics_contact._pairing.torsion import with_turn

    return with_turn(points, scene)
