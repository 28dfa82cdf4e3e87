"""Contact points of a scene, by nodes and by mortar, with the gaps that pairs give.

Where the gap g closes, the slave moves by (1 − s) g and the master by s g, s its share of the compliance, up
to rigid motions. The constraint contains linear interpolants of that, I g on the slave and J g on the master:
it can close (1 − s) g(x_i) + s ∫ ψ_i J g. The mean of g itself includes its curvature between nodes. Nodes
that are partly beside the other surface keep that mean, and so do points with several nodes of the slave.

Dual functions are negative in places. Where a surface turns away from the other one in a crease, so that the
gap is no smooth function, such a mean may be below all gaps of the nodes in it, and bodies that only touch
would be pressed apart: there no point has less than the gap of its node. This holds for each point by itself,
so that gaps are continuous functions of a design.
"""

from __future__ import annotations

import logging
from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import TYPE_CHECKING

import numpy as np
import scipy.sparse as sp

from fenics_contact._base.display import displayed
from fenics_contact._base.fingerprint import described, require_alike
from fenics_contact._base.libraries import MPI
from fenics_contact._pairing.advice import SILENCE, Advice
from fenics_contact._pairing.coupling_derivatives import CouplingDerivatives
from fenics_contact._pairing.points import (
    ContactPoints,
    NodeNumbers,
    in_free_frames,
    join_points,
    reference_axes,
    tangent_frames,
    with_symmetry,
)
from fenics_contact._pairing.projection import shared_projection
from fenics_contact._pairing.tips import carrying
from fenics_contact._scene.local_axes import NO_AXES, LocalAxes
from fenics_contact._scene.obstacles import RigidObstacle, RigidTool
from fenics_contact._scene.pair_geometry import master_share
from fenics_contact._scene.pairs import ContactPair, Surface, Tie
from fenics_contact._scene.parts import as_mortar_slave, surface_of
from fenics_contact._scene.scene import Scene
from fenics_contact._scene.sectors import AnyTie, CyclicSymmetry
from fenics_contact._scene.thickness import thickness_on
from fenics_contact._scene.tools import ToolBody
from fenics_contact._scene.touching import may_touch
from fenics_contact._surfaces.facets import FacetedSurface
from fenics_contact._surfaces.projection import Projection, node_weights
from fenics_contact._surfaces.true_surface import Geometry, wedges_of
from fenics_contact.errors import InvalidDesignError, InvalidInputError, together
from fenics_contact.errors.kinds import safe_log
from fenics_contact.mesh.faces import computed_rounding, coordinate_rounding
from fenics_contact.shapes.simple import evaluate_shape

if TYPE_CHECKING:
    from fenics_contact._pairing.mortar.coupling import MortarCoupling
    from fenics_contact._pairing.mortar.derivatives import SurfaceDerivatives
    from fenics_contact._pairing.mortar.gathering import CondensedDualBasis


@dataclass(frozen=True)
class ClosableGaps:
    """Gaps of a coupling and what they consist of.

    Attributes:
        value: The gaps, shape (n,), [length].
        kept: Whether it is the coupling's own mean, shape (n,).
        share: Part of each that comes from the nodes of the master, s or zero, shape (n,).
        here: Projections of slave nodes onto the master, numbered as ``slave.nodes``.
        there: Projections of master nodes onto the slave, numbered as ``master.nodes``.
        own: Gaps of the slave nodes, zero where there is none, shape (len(slave.nodes),), [length].
        opposite: Their gaps, zero where there is none, shape (len(master.nodes),), [length].
        nodal: Whether it is the gap of the node alone, at creases, shape (n,).
    """

    value: np.ndarray
    kept: np.ndarray
    share: np.ndarray
    here: Projection
    there: Projection
    own: np.ndarray
    opposite: np.ndarray
    nodal: np.ndarray

    def by_nodes(self, coupling: MortarCoupling, by_own: np.ndarray) -> np.ndarray:
        """Vector-Jacobian product of the slave's part of the gaps with respect to `own`, in its shape.

        `by_own`: derivative by that part, shape (n,).
        """
        result = coupling.of_slave_pulled_back(np.where(self.nodal, 0.0, by_own), len(self.own))
        result[coupling.node[self.nodal]] += by_own[self.nodal]
        return result


def closable_gaps(
    slave: FacetedSurface,
    master: FacetedSurface,
    coupling: MortarCoupling,
    share: float,
    comm: MPI.Comm,
    alone: np.ndarray,
    creased: np.ndarray,
) -> ClosableGaps:
    """Return the gaps that linear displacements can close. Collective.

    `comm`: communicator of the ranks that share the work; `alone`: whether a point has no dual function but
    its own, shape (n,); others keep their mean; `creased`: which are at creases, shape (n,).
    """
    weight, mine = coupling.weight, coupling.node
    if coupling.own is not None:
        mine = np.flatnonzero(np.bincount(coupling.own.indices, minlength=len(slave.nodes)))
    nodes = np.flatnonzero(np.bincount(weight.indices, minlength=weight.shape[1]))
    if master.followed is not None:
        nodes = np.union1d(nodes, master.followed[nodes].indices)
    here = shared_projection(slave, mine, master, comm)
    there = shared_projection(master, nodes, slave, comm)
    here, there = (
        replace(hit, point=chosen[hit.point], lost=chosen[hit.lost])
        for hit, chosen in ((here, mine), (there, nodes))
    )
    gaps, opposite = np.full(len(slave.nodes), np.nan), np.full(weight.shape[1], np.nan)
    gaps[here.point], opposite[there.point] = here.gap, there.gap
    if slave.followed is not None:  # displacements can close the mean of their masters' gaps there
        gaps = slave.followed @ gaps
    own = coupling.of_slave(gaps)
    if master.followed is not None:
        opposite = master.followed @ opposite
    lost = abs(weight) @ np.isnan(opposite).astype(np.float64) > 0
    opposite = np.nan_to_num(opposite)
    across = np.where(lost, own, weight @ opposite)
    closable = (1.0 - share) * own + share * across
    kept = np.isnan(closable) | ~alone
    value = np.where(kept, coupling.gap, closable)
    at_node = gaps[coupling.node]
    nodal = creased & (value < at_node)
    value, kept = np.where(nodal, at_node, value), kept & ~nodal
    shares = np.where(lost | kept | nodal, 0.0, share)
    return ClosableGaps(value, kept, shares, here, there, np.nan_to_num(gaps), opposite, nodal)


def _at_creases(slave: FacetedSurface, master: FacetedSurface, coupling: MortarCoupling) -> np.ndarray:
    """Return which points have nodes at creases of either surface in their means, shape (n,)."""
    sharp = [
        (np.bincount(wedges_of(side).node, minlength=len(side.nodes)) > 1).astype(float)
        for side in (slave, master)
    ]
    found = abs(coupling.weight) @ sharp[1]
    own = sharp[0][coupling.node] if coupling.own is None else abs(coupling.own) @ sharp[0]
    return np.asarray(found + own > 0.0)


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


@displayed
@dataclass(frozen=True)
class MortarPoints:
    """Slave nodes with the mean of the master that each of them meets.

    Attributes:
        coupling: Their coupling, at some of its nodes.
        gathering: What the nodes gather of others that hardly face the master; None if there are none.
        closable: Gaps that linear displacements can close; None where both surfaces are their facets.
    """

    slave: FacetedSurface
    master: FacetedSurface
    coupling: MortarCoupling
    gathering: CondensedDualBasis | None
    closable: ClosableGaps | None

    @classmethod
    def of(
        cls,
        slave: FacetedSurface,
        master: FacetedSurface,
        bearing: np.ndarray,
        share: float,
        comm: MPI.Comm | None = None,
        movable: np.ndarray | None = None,
    ) -> MortarPoints:
        """Couple two surfaces. Collective on ``comm``.

        `bearing`: which slave nodes may carry one, shape (n_nodes,); `comm`: communicator of the ranks that
        share the work; this one by default; `movable`: which of them supports leave free, by default those.
        """
        from fenics_contact._pairing.mortar.by_master import with_inclined
        from fenics_contact._pairing.mortar.coupling import mortar_coupling
        from fenics_contact._pairing.mortar.gathering import CondensedDualBasis

        comm = comm or MPI.COMM_SELF
        slave, coupling = with_inclined(slave, master, mortar_coupling(slave, master, comm))
        gathering = CondensedDualBasis.of(coupling, slave, bearing if movable is None else movable)
        if gathering is not None:
            coupling = gathering.coupling(slave, master)
        chosen = np.flatnonzero(bearing[coupling.node])
        coupling = coupling.part(chosen)
        gathering = None if gathering is None else gathering.chosen(chosen)
        flat, closable = slave.relief is None and master.relief is None, None
        alone = np.full(len(chosen), not flat) if gathering is None or flat else ~gathering.gathers
        creased = _at_creases(slave, master, coupling)
        if not flat or creased.any():
            closable = closable_gaps(slave, master, coupling, share, comm, alone, creased)
        return cls(slave, master, coupling, gathering, closable)

    @property
    def gap(self) -> np.ndarray:
        """The gaps, shape (n,), [length]."""
        return self.coupling.gap if self.closable is None else self.closable.value

    @property
    def weight(self) -> sp.csr_matrix:
        """Weights of the nodes of slave and, after them, of master in the point that a slave node meets.

        Nodes of the slave have such weights where several of them are in its mean, which takes the place of
        the node. Rows add up to one, shape (n, len(slave.nodes) + len(master.nodes)).
        """
        count, n_slave = len(self.coupling.node), len(self.slave.nodes)
        lacking, own = sp.csr_matrix((count, n_slave)), self.coupling.own
        if own is not None:
            entries = np.ones(count), self.coupling.node, np.arange(count + 1)
            lacking = sp.csr_matrix(entries, shape=lacking.shape) - own
            lacking.eliminate_zeros()
        return sp.hstack([lacking, self.coupling.weight], format="csr")

    def pulled_back(
        self, by: CouplingDerivatives, comm: MPI.Comm | None = None
    ) -> tuple[SurfaceDerivatives, SurfaceDerivatives]:
        """Vector-Jacobian product of the coupling by slave and master. Collective on ``comm``."""
        from fenics_contact._pairing.mortar.by_master import NormalsPulledBack
        from fenics_contact._pairing.mortar.derivatives import mortar_pulled_back

        slave, master, coupling, gathering = self.slave, self.master, self.coupling, self.gathering
        if gathering is None:
            return mortar_pulled_back(slave, master, coupling, by, comm)
        turned = NormalsPulledBack.of(slave, master, coupling, by)
        whole, places = gathering.whole, (slave.points, master.points)
        by_whole = gathering.pulled_back(coupling, turned.with_weights(by, master), places)
        by_slave, by_master = mortar_pulled_back(slave, master, whole, by_whole, comm)
        along = by.gap[:, None] * coupling.normal
        by_slave.normals[coupling.node] += turned.slave
        by_master.normals[:] += turned.master
        by_slave.points[:] += coupling.of_slave_pulled_back(along, len(slave.nodes))
        by_master.points[:] -= coupling.weight.T @ along
        return by_slave, by_master


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
    return _points_of_pairs(scene, scene.contacts, (fixed, axes), comm or MPI.COMM_SELF, finer, advice)


def find_tied_points(
    scene: Scene,
    fixed: np.ndarray,
    comm: MPI.Comm | None = None,
    *,
    axes: LocalAxes = NO_AXES,
    advice: Advice = SILENCE,
) -> ContactPoints:
    """Find the points of tied surfaces, as `find_contact_points`; ``pair`` numbers the ties. Collective."""
    return _points_of_pairs(scene, scene.ties, (fixed, axes), comm or MPI.COMM_SELF, advice=advice)


def without_rounding(gap: np.ndarray, points: np.ndarray) -> np.ndarray:
    """Return gaps, zero where surfaces touch up to the rounding of their coordinates.

    Otherwise bodies that only touch would be pressed apart by that rounding.

    `gap`: gaps, shape (n,), [length]; `points`: coordinates of one of the surfaces, shape (m, dim), [length].
    """
    return np.where(np.abs(gap) <= computed_rounding(points), 0.0, gap)


@dataclass(frozen=True)
class _Side:
    """One of two surfaces of a pair.

    Attributes:
        nodes: Its nodes among those of all bodies, shape (n,).
    """

    surface: FacetedSurface
    nodes: np.ndarray
    n_nodes: int

    @classmethod
    def of(
        cls, scene: Scene, surface: Surface, geometry: Geometry, numbers: NodeNumbers, finer: bool
    ) -> _Side:
        """Return a named surface as a side."""
        own = surface_of(scene, surface, geometry, finer=finer)
        return cls(own, numbers.global_nodes(surface.body, own.nodes), numbers.n_nodes)

    def turned(self, sector: CyclicSymmetry, angle: float) -> _Side:
        """Return the side where a sector has its other one."""
        points = sector.turned(self.surface.points, angle)
        averaged = self.surface.averaged @ sector.matrix(angle).T
        return replace(self, surface=replace(self.surface, points=points, averaged=averaged))

    def weights(self, hit: Projection) -> sp.csr_matrix:
        """Return the weights of the nodes of all bodies at projections on this side, (n, n_nodes)."""
        own = node_weights(self.surface, hit)
        return sp.csr_matrix((own.data, self.nodes[own.indices], own.indptr), (own.shape[0], self.n_nodes))


def _points_of_pairs(
    scene: Scene,
    pairs: Sequence[ContactPair | AnyTie],
    supported: tuple[np.ndarray, LocalAxes],
    comm: MPI.Comm,
    finer: bool = False,
    advice: Advice = SILENCE,
) -> ContactPoints:
    fixed, axes = supported
    parts = []
    for index, pair in enumerate(pairs):
        if isinstance(pair, ContactPair) and pair.is_self_contact:
            continue  # no part of an undeformed body is near another one
        points = _measured(scene, pair, index, supported, comm, finer, advice)
        if isinstance(pair, ContactPair) and pair.given_gap:
            origin, mesh = scene.origin, scene.bodies[pair.slave.body].mesh.origin
            first = points
            if origin is not scene:
                first = _measured(origin, pair, index, supported, comm, finer, SILENCE)
            slave = first.slave - NodeNumbers.of(scene).first_of(pair.slave.body)
            points = with_given_gaps(points, first, pair, mesh.points[slave], comm)
        if scene.has_thickness:
            thickness = thickness_on(
                scene.bodies[pair.slave.body], pair.slave.name, f"the slave of {pair.place}"
            )
            points = replace(points, length=points.sizes, area=points.area * thickness)
        if scene.torsion:
            from fenics_contact._pairing.torsion import with_turn

            parts.append(with_turn(points, scene))
        else:
            parts.append(in_free_frames(points, fixed, axes))
    return join_points(parts, scene.components, len(fixed))


def _measured(
    scene: Scene,
    pair: ContactPair | AnyTie,
    index: int,
    supported: tuple[np.ndarray, LocalAxes],
    comm: MPI.Comm,
    finer: bool,
    advice: Advice,
) -> ContactPoints:
    """Return the points of one pair with the gaps between its surfaces. Collective."""
    fixed, axes = supported
    numbers = NodeNumbers.of(scene)
    alone = isinstance(pair, ContactPair) and pair.nodes is not None
    geometry = pair.slave_geometry if isinstance(pair, ContactPair) else pair.geometry
    slave = _Side.of(scene, pair.slave, geometry, numbers, finer and not alone)
    if pair.discretisation == "mortar":
        slave = replace(slave, surface=as_mortar_slave(scene, pair.slave, slave.surface))
    movable = ~fixed[slave.nodes].all(axis=1)
    if isinstance(pair, CyclicSymmetry):
        axial = pair.axial_nodes(scene.bodies[pair.slave.body].mesh, pair.slave.name)
        movable &= ~np.isin(slave.nodes, numbers.global_nodes(pair.slave.body, axial))
    bearing = movable & may_touch(scene.bodies, pair, slave.surface)
    advice.surface(scene, pair.slave, pair.geometry, slave.surface, comm)
    master: _Side | RigidObstacle
    if isinstance(pair.master, Surface):
        master = _Side.of(scene, pair.master, pair.geometry, numbers, finer)
    else:
        master = pair.master
    if isinstance(pair, ContactPair):
        with together(comm):
            bearing &= carrying(pair, slave.surface, master.surface if isinstance(master, _Side) else master)
    if not isinstance(master, _Side):
        with together(comm):
            points = _on_obstacle(slave, bearing, master)
            if isinstance(master, RigidTool):
                points = _carried(points, slave, master, scene, numbers)
        name = f"what ContactPair {index} asks its obstacle, {type(master).__name__}"
        require_alike(comm, described((points.slave, points.normal, points.gap), name))
    else:
        if isinstance(pair, CyclicSymmetry):
            from fenics_contact._pairing.sectors import check_sides

            angle = pair.angle_in(scene)
            master = master.turned(pair, angle)
            with together(comm):
                check_sides(pair, angle, slave.surface, master.surface)
        assert isinstance(pair.master, Surface)
        advice.surface(scene, pair.master, pair.geometry, master.surface, comm)
        if isinstance(pair, Tie) and not pair.sliding and not axes:
            one, other = ((side.surface, fixed[side.nodes]) for side in (slave, master))
            advice.free_master(pair, one, other, comm)
        if pair.discretisation == "mortar":
            # Of linear facets only what supports hold: a hanging node, say, moves and keeps its function.
            free = ~fixed[slave.nodes].all(axis=1) if slave.surface.whole is None else None
            points = _by_mortar(slave, bearing, master, comm, master_share(scene, pair), free)
        else:
            points = _by_projection(slave, bearing, master, comm)
            advice.uneven_pressure(scene, pair, slave.surface, master.surface, comm)
            if not isinstance(pair, ContactPair):
                held = ~movable | np.isin(slave.nodes, points.slave)
                advice.edge_of_tie(pair, slave.surface, held, master.surface, comm)
        if isinstance(pair, CyclicSymmetry):
            turn = np.tile(pair.matrix(angle), (points.count, 1, 1))
            points = replace(points, turns=turn)
        else:
            points = with_symmetry(points, _symmetric(points, slave, master), slave.surface.planes)
    if comm.rank == 0 and not movable.all():
        safe_log(
            _LOG.info,
            "%d of %d nodes of %s %d are left out as supports hold them in all directions",
            np.count_nonzero(~movable), len(movable), type(pair).__name__, index,
        )  # fmt: skip
    if points.count == 0:
        raise InvalidInputError(
            f"{type(pair).__name__} {index} needs slave nodes that face the master, but none of the "
            f"{np.count_nonzero(movable)} movable nodes of {pair.slave.name!r} meets it: "
            f"{_cure_of_no_points(scene, pair)}"
        )
    gap = without_rounding(points.gap, slave.surface.points)
    points = replace(points, pair=np.full(points.count, index), gap=gap, distance=gap)
    if not scene.has_hanging_nodes:
        return points
    from fenics_contact._pairing.following import on_masters

    return on_masters(points, scene, pair.slave.body, pair.discretisation == "mortar")


def _cure_of_no_points(scene: Scene, pair: ContactPair | AnyTie) -> str:
    """Return what to do where no slave node faces the master."""
    if not isinstance(pair.master, Surface):
        distance = evaluate_shape(pair.master, "distance", scene.bodies[pair.slave.body].mesh.points)
        if distance.mean() < 0.0:
            return (
                f"body {pair.slave.body!r} lies inside the {type(pair.master).__name__}, whose normal points "
                "out of it and towards the body: reverse it (a plane's normal), or take its other side"
            )
    return "check the surfaces' names and where the bodies lie"


def _symmetric(points: ContactPoints, slave: _Side, master: _Side) -> np.ndarray:
    """Return the symmetry planes that cut both surfaces at a point, (n_points, n_planes)."""
    place = np.zeros((slave.n_nodes, points.normal.shape[1]))
    cut = np.zeros((2, slave.n_nodes, slave.surface.mirrored.shape[1]), dtype=bool)
    for here, side in zip(cut, (slave, master), strict=True):
        place[side.nodes], here[side.nodes] = side.surface.points, side.surface.mirrored
    met = points.master.tocoo()
    node, other = points.slave[met.row], met.col
    same = np.abs(slave.surface.across(place[node] - place[other])) <= coordinate_rounding(place)
    symmetric = np.zeros((points.count, cut.shape[2]), dtype=bool)
    np.logical_or.at(symmetric, met.row, cut[0][node] & cut[1][other] & same)
    return symmetric


def _by_projection(slave: _Side, movable: np.ndarray, master: _Side, comm: MPI.Comm) -> ContactPoints:
    """Pair each slave node with the master facet on which it projects. Collective."""
    candidates = np.flatnonzero(movable)
    hit = shared_projection(slave.surface, candidates, master.surface, comm)
    if len(hit.lost) and comm.rank == 0:
        _tell_of_lost(slave.surface.points[candidates[hit.lost]], len(candidates))
    points = _points(slave, candidates[hit.point], hit.normal, hit.gap, master.weights(hit))
    return replace(points, facet=hit.facet, local=hit.local)


def _tell_of_lost(places: np.ndarray, count: int) -> None:
    where = ", ".join(f"{x:.6g}" for x in places[0])
    safe_log(
        _LOG.warning,
        "%d of %d slave nodes face their master, but no point of it was found for them, the first at (%s): "
        "nothing keeps them out of it; refine the master there, or let the other surface be the slave",
        len(places), count, where,
    )  # fmt: skip


def _by_mortar(
    slave: _Side,
    bearing: np.ndarray,
    master: _Side,
    comm: MPI.Comm,
    share: float,
    movable: np.ndarray | None,
) -> ContactPoints:
    """Pair each slave node with the mean of the master weighted by its dual basis function. Collective.

    `bearing`, `movable`: as of `MortarPoints.of`; `comm`: communicator of the ranks that share the work.
    """
    met = MortarPoints.of(slave.surface, master.surface, bearing, share, comm, movable)
    coupling, nodes = met.coupling, np.concatenate([slave.nodes, master.nodes])
    count = len(nodes)
    spread = sp.csr_matrix((np.ones(count), (np.arange(count), nodes)), shape=(count, master.n_nodes))
    points = _points(slave, coupling.node, coupling.normal, met.gap, (met.weight @ spread).tocsr())
    return replace(points, area=coupling.area)


def _on_obstacle(slave: _Side, movable: np.ndarray, obstacle: RigidObstacle) -> ContactPoints:
    """Pair each slave node that faces a rigid obstacle with it."""
    candidates = np.flatnonzero(movable)
    normals = evaluate_shape(obstacle, "normals", slave.surface.points[candidates])
    facing = np.einsum("nd,nd->n", slave.surface.normals[candidates], normals) < 0
    chosen = candidates[facing]
    gap = evaluate_shape(obstacle, "distance", slave.surface.points[chosen])
    points = _points(slave, chosen, normals[facing], gap, sp.csr_matrix((len(chosen), slave.n_nodes)))
    return with_symmetry(points, slave.surface.mirrored[chosen], slave.surface.planes)


def _carried(
    points: ContactPoints, slave: _Side, tool: RigidTool, scene: Scene, numbers: NodeNumbers
) -> ContactPoints:
    """Return points of a tool with the weights of the nodes that carry its motion."""
    body = scene.bodies[tool.name]
    assert isinstance(body, ToolBody)
    weight = body.weights(scene.points[points.slave])
    nodes = np.tile(numbers.global_nodes(tool.name, np.arange(body.mesh.n_nodes)), points.count)
    rows = weight.shape[1] * np.arange(points.count + 1)
    master = sp.csr_matrix((weight.ravel(), nodes, rows), shape=(points.count, slave.n_nodes))
    return replace(points, master=master)


def _points(
    slave: _Side, chosen: np.ndarray, normal: np.ndarray, gap: np.ndarray, weight: sp.csr_matrix
) -> ContactPoints:
    """Return points on chosen nodes of a slave, not yet numbered by pair and without facets."""
    count, axes = len(chosen), reference_axes(normal)
    return ContactPoints(
        np.zeros(count, dtype=np.int64), slave.nodes[chosen], weight, normal, tangent_frames(normal, axes),
        gap, slave.surface.point_areas[chosen], np.full(count, -1), np.zeros((count, normal.shape[1] - 1)),
        axes, np.zeros(normal.shape, dtype=bool), gap, np.zeros(count, dtype=bool),
        length=slave.surface.sizes[chosen] if slave.surface.measure.varies else None,
    )  # fmt: skip
