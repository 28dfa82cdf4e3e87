"""Contact points of a scene: the counterpart on the master, normal and gap of each slave node."""

from __future__ import annotations

import logging
from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np
import scipy.sparse as sp

from fenics_contact._libraries import MPI
from fenics_contact.errors import InvalidInputError, safe_log, together
from fenics_contact.fingerprint import described, require_alike
from fenics_contact.mesh import computed_rounding, coordinate_rounding
from fenics_contact.pairing.contact_points import (
    ContactPoints,
    in_free_frames,
    join_points,
    reference_axes,
    tangent_frames,
)
from fenics_contact.pairing.given_gaps import with_given_gaps
from fenics_contact.pairing.mortar_points import MortarPoints
from fenics_contact.pairing.node_numbers import NodeNumbers
from fenics_contact.pairing.shared_projection import shared_projection
from fenics_contact.pairing.surface_doubts import warn_of_surface
from fenics_contact.pairing.tied_edges import warn_of_edge
from fenics_contact.pairing.uneven_pressure import warn_of_uneven_pressure
from fenics_contact.scene import ContactPair, RigidObstacle, Scene, Surface, Tie, master_share, surface_of
from fenics_contact.surface_shapes import evaluate_shape
from fenics_contact.surfaces import (
    FacetedSurface,
    Geometry,
    Projection,
    node_weights,
)

_LOG = logging.getLogger(__name__)


def find_contact_points(
    scene: Scene,
    fixed: np.ndarray,
    comm: MPI.Comm | None = None,
    *,
    finer: bool = False,
    told: bool = False,
) -> ContactPoints:
    """Find the contact points of every contact pair. Collective on ``comm``.

    Each rank searches a share of the nodes, and all receive all points. Nodes whose displacement is
    prescribed in all components cannot move and are omitted.

    Args:
        scene: The scene.
        fixed: Whether a component of a node is prescribed, shape (n_nodes, dim).
        comm: Communicator of the ranks that share the work; this rank alone by default.
        finer: Use better representations of surfaces than requested by the scene, see `true_surface`.
        told: Whether doubts about the surfaces were told.

    Raises:
        InvalidInputError: If no node of a slave surface faces its master.
    """
    return _points_of_pairs(scene, scene.contacts, fixed, comm or MPI.COMM_SELF, finer, told)


def find_tied_points(
    scene: Scene, fixed: np.ndarray, comm: MPI.Comm | None = None, *, told: bool = False
) -> ContactPoints:
    """Find the points of tied surfaces, as `find_contact_points`; ``pair`` numbers the ties. Collective."""
    return _points_of_pairs(scene, scene.ties, fixed, comm or MPI.COMM_SELF, told=told)


def without_rounding(gap: np.ndarray, points: np.ndarray) -> np.ndarray:
    """Return gaps, zero where surfaces touch up to the rounding of their coordinates.

    Otherwise bodies that only touch would be pressed apart by that rounding.

    Args:
        gap: Gaps, shape (n,), [length].
        points: Coordinates of one of the surfaces, shape (m, dim), [length].
    """
    return np.where(np.abs(gap) <= computed_rounding(points), 0.0, gap)


@dataclass(frozen=True)
class _Side:
    """One of two surfaces of a pair.

    Attributes:
        surface: The surface.
        nodes: Its nodes among those of all bodies, shape (n,).
        n_nodes: Number of nodes of all bodies.
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

    def weights(self, hit: Projection) -> sp.csr_matrix:
        """Return the weights of the nodes of all bodies at projections on this side, (n, n_nodes)."""
        own = node_weights(self.surface, hit)
        return sp.csr_matrix((own.data, self.nodes[own.indices], own.indptr), (own.shape[0], self.n_nodes))


def _points_of_pairs(
    scene: Scene,
    pairs: Sequence[ContactPair | Tie],
    fixed: np.ndarray,
    comm: MPI.Comm,
    finer: bool = False,
    told: bool = False,
) -> ContactPoints:
    parts, told = [], told or finer
    for index, pair in enumerate(pairs):
        if isinstance(pair, ContactPair) and pair.within_body:
            continue  # no part of an undeformed body is near another one
        points = _measured(scene, pair, index, fixed, comm, finer, told=told)
        if isinstance(pair, ContactPair) and pair.given_gap:
            origin, mesh = scene.origin, scene.bodies[pair.slave.body].mesh.origin
            first = points
            if origin is not scene:
                first = _measured(origin, pair, index, fixed, comm, finer, told=True)
            slave = first.slave - NodeNumbers.of(scene).first_of(pair.slave.body)
            points = with_given_gaps(points, first, pair, mesh.points[slave], comm)
        parts.append(in_free_frames(points, fixed))
    return join_points(parts, scene.dim, len(fixed))


def _measured(
    scene: Scene,
    pair: ContactPair | Tie,
    index: int,
    fixed: np.ndarray,
    comm: MPI.Comm,
    finer: bool,
    told: bool,
) -> ContactPoints:
    """Return the points of one pair with the gaps between its surfaces. Collective."""
    numbers = NodeNumbers.of(scene)
    slave = _Side.of(scene, pair.slave, pair.geometry, numbers, finer)
    movable = ~fixed[slave.nodes].all(axis=1)
    bearing = movable & (slave.surface.areas > 0.0) if isinstance(pair, ContactPair) else movable
    if not told:
        warn_of_surface(scene, pair.slave, pair.geometry, slave.surface, comm)
    if not isinstance(pair.master, Surface):
        with together(comm):
            points = _on_obstacle(slave, bearing, pair.master)
        name = f"what ContactPair {index} asks its obstacle, {type(pair.master).__name__}"
        require_alike(comm, described((points.slave, points.normal, points.gap), name))
    else:
        master = _Side.of(scene, pair.master, pair.geometry, numbers, finer)
        if not told:
            warn_of_surface(scene, pair.master, pair.geometry, master.surface, comm)
        if pair.discretisation == "mortar":
            points = _by_mortar(slave, bearing, master, comm, master_share(scene, pair))
        else:
            points = _by_projection(slave, bearing, master, comm)
            if not told:
                warn_of_uneven_pressure(scene, pair, slave.surface, master.surface, comm)
            if isinstance(pair, Tie):
                held = ~movable | np.isin(slave.nodes, points.slave)
                warn_of_edge(pair, slave.surface, held, master.surface, comm)
        points = replace(points, symmetric=_symmetric(points, slave, master))
    if comm.rank == 0 and not movable.all():
        safe_log(
            _LOG.info,
            "%d of %d nodes of %s %d are left out as supports hold them in all directions",
            np.count_nonzero(~movable), len(movable), type(pair).__name__, index,
        )  # fmt: skip
    if points.count == 0:
        raise InvalidInputError(
            f"{type(pair).__name__} {index} needs slave nodes that face the master, but none of the "
            f"{np.count_nonzero(movable)} movable nodes of {pair.slave.name!r} meets it: check the "
            "surfaces' names and where the bodies lie"
        )
    gap = without_rounding(points.gap, slave.surface.points)
    return replace(points, pair=np.full(points.count, index), gap=gap, distance=gap)


def _symmetric(points: ContactPoints, slave: _Side, master: _Side) -> np.ndarray:
    """Return the components normal to symmetry planes that cut both surfaces at a point, (n_points, dim)."""
    place = np.zeros((slave.n_nodes, points.normal.shape[1]))
    cut = np.zeros((2, *place.shape), dtype=bool)
    for here, side in zip(cut, (slave, master), strict=True):
        place[side.nodes], here[side.nodes] = side.surface.points, side.surface.mirrored
    met = points.master.tocoo()
    node, other = points.slave[met.row], met.col
    same = np.abs(place[node] - place[other]) <= coordinate_rounding(place)
    symmetric = np.zeros(points.normal.shape, dtype=bool)
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
    slave: _Side, movable: np.ndarray, master: _Side, comm: MPI.Comm, share: float
) -> ContactPoints:
    """Pair each slave node with the mean of the master weighted by its dual basis function. Collective.

    Args:
        slave: Side whose nodes carry multipliers.
        movable: Which of them can move.
        master: The other side.
        comm: Communicator of the ranks that share the work.
        share: The master's share of the motion that closes the gap.
    """
    met = MortarPoints.of(slave.surface, master.surface, movable, share, comm)
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
    return replace(points, symmetric=slave.surface.mirrored[chosen])


def _points(
    slave: _Side, chosen: np.ndarray, normal: np.ndarray, gap: np.ndarray, weight: sp.csr_matrix
) -> ContactPoints:
    """Return points on chosen nodes of a slave, not yet numbered by pair and without facets."""
    count, axes = len(chosen), reference_axes(normal)
    return ContactPoints(
        np.zeros(count, dtype=np.int64), slave.nodes[chosen], weight, normal, tangent_frames(normal, axes),
        gap, slave.surface.areas[chosen], np.full(count, -1), np.zeros((count, normal.shape[1] - 1)), axes,
        np.zeros(normal.shape, dtype=bool), gap, np.zeros(count, dtype=bool),
    )  # fmt: skip
