"""Contact points of a scene: which slave node meets the master where, in which direction, how far away."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np
import scipy.sparse as sp
from mpi4py import MPI

from fenics_contact.errors import InvalidInputError, together
from fenics_contact.feti.contact_points import ContactPoints, join_points, tangent_frames
from fenics_contact.feti.copies import Tearing
from fenics_contact.feti.facet_areas import nodal_areas
from fenics_contact.feti.projection import Projection, join, project
from fenics_contact.feti.surface import FacetedSurface, faceted_surface, shape_functions
from fenics_contact.scene import ContactPair, RigidObstacle, Scene, Surface, Tie


def find_contact_points(
    scene: Scene, tearing: Tearing, fixed: np.ndarray, comm: MPI.Comm = MPI.COMM_SELF
) -> ContactPoints:
    """Find where the slave surface of every contact pair meets its master. Collective on ``comm``.

    Each rank does a share of the search, and all receive all points. Nodes whose displacement is prescribed
    in all components cannot move and are left out.

    Args:
        scene: The scene.
        tearing: Node numbering.
        fixed: Whether a component of a node is prescribed, shape (n_nodes, dim).
        comm: Communicator of the ranks that share the work.

    Raises:
        InvalidInputError: If no node of a slave surface finds its master.
    """
    return _points_of_pairs(scene, scene.contacts, tearing, fixed, comm)


def find_tied_points(
    scene: Scene, tearing: Tearing, fixed: np.ndarray, comm: MPI.Comm = MPI.COMM_SELF
) -> ContactPoints:
    """Find where tied surfaces meet, as `find_contact_points` does; ``pair`` counts the ties. Collective."""
    return _points_of_pairs(scene, scene.ties, tearing, fixed, comm)


def surface_of(scene: Scene, surface: Surface) -> FacetedSurface:
    """Return a named surface with its averaged normals: linear facets through its nodes."""
    mesh = scene.bodies[surface.body].mesh
    found = faceted_surface(mesh.points, scene.facets(surface))
    if mesh.order == 1:
        return found
    # The area of a node is the force that a unit pressure puts there, which is not what linear facets say.
    facets = mesh.surfaces[surface.name]
    areas = np.bincount(facets.ravel(), nodal_areas(mesh.points, facets).ravel(), minlength=mesh.n_nodes)
    return replace(found, areas=areas[found.nodes])


@dataclass(frozen=True)
class _Side:
    """One of two surfaces that meet.

    Attributes:
        surface: The surface.
        nodes: Its nodes among those of all bodies, shape (n,).
        n_nodes: Number of nodes of all bodies.
    """

    surface: FacetedSurface
    nodes: np.ndarray
    n_nodes: int

    @classmethod
    def of(cls, scene: Scene, surface: Surface, tearing: Tearing) -> _Side:
        """Return a named surface as a side."""
        own = surface_of(scene, surface)
        return cls(own, tearing.global_nodes(surface.body, own.nodes), tearing.n_nodes)


def _points_of_pairs(
    scene: Scene, pairs: Sequence[ContactPair | Tie], tearing: Tearing, fixed: np.ndarray, comm: MPI.Comm
) -> ContactPoints:
    parts = []
    for index, pair in enumerate(pairs):
        slave = _Side.of(scene, pair.slave, tearing)
        movable = ~fixed[slave.nodes].all(axis=1)
        if not isinstance(pair.master, Surface):
            points = _on_obstacle(slave, movable, pair.master)
        else:
            find = _by_mortar if pair.discretisation == "mortar" else _by_projection
            points = find(slave, movable, _Side.of(scene, pair.master, tearing), comm)
        if points.count == 0:
            raise InvalidInputError(
                f"{type(pair).__name__} {index} needs slave nodes that face the master, but none of the "
                f"{np.count_nonzero(movable)} movable nodes of {pair.slave.name!r} meets it: check the "
                "surfaces' names and where the bodies lie"
            )
        parts.append(replace(points, pair=np.full(points.count, index)))
    return join_points(parts, scene.dim, len(fixed))


def _by_projection(slave: _Side, movable: np.ndarray, master: _Side, comm: MPI.Comm) -> ContactPoints:
    """Let each slave node meet the master facet that it projects on. Collective."""
    candidates = np.flatnonzero(movable)
    hit = _shared_projection(slave.surface, candidates, master.surface, comm)
    values, _ = shape_functions(hit.local, master.surface.corners)
    corners = master.nodes[master.surface.facets[hit.facet]]
    row = np.repeat(np.arange(len(hit.point)), master.surface.corners)
    shape = (len(hit.point), slave.n_nodes)
    weight = sp.csr_matrix((values.ravel(), (row, corners.ravel())), shape=shape)
    chosen = candidates[hit.point]
    return replace(_points(slave, chosen, hit.normal, hit.gap, weight), facet=hit.facet, local=hit.local)


def _by_mortar(slave: _Side, movable: np.ndarray, master: _Side, comm: MPI.Comm) -> ContactPoints:
    """Let each slave node meet the mean of the master under its dual basis function. Collective."""
    from fenics_contact.feti.mortar import mortar_coupling  # not before a pair asks for it

    found = mortar_coupling(slave.surface, master.surface, comm)
    kept = np.flatnonzero(movable[found.node])
    count = len(master.nodes)
    spread = sp.csr_matrix((np.ones(count), (np.arange(count), master.nodes)), shape=(count, master.n_nodes))
    weight = (found.weight[kept] @ spread).tocsr()
    points = _points(slave, found.node[kept], found.normal[kept], found.gap[kept], weight)
    return replace(points, area=found.area[kept])


def _on_obstacle(slave: _Side, movable: np.ndarray, obstacle: RigidObstacle) -> ContactPoints:
    """Let each slave node that faces a rigid obstacle meet it."""
    candidates = np.flatnonzero(movable)
    normals = obstacle.normals(slave.surface.points[candidates])
    facing = np.einsum("nd,nd->n", slave.surface.normals[candidates], normals) < 0
    chosen = candidates[facing]
    gap = obstacle.distance(slave.surface.points[chosen])
    return _points(slave, chosen, normals[facing], gap, sp.csr_matrix((len(chosen), slave.n_nodes)))


def _points(
    slave: _Side, chosen: np.ndarray, normal: np.ndarray, gap: np.ndarray, weight: sp.csr_matrix
) -> ContactPoints:
    """Return points on chosen nodes of a slave, not yet numbered by pair and on no facet."""
    count = len(chosen)
    return ContactPoints(
        np.zeros(count, dtype=np.int64), slave.nodes[chosen], weight, normal, tangent_frames(normal), gap,
        slave.surface.areas[chosen], np.full(count, -1), np.zeros((count, normal.shape[1] - 1)),
    )  # fmt: skip


def _shared_projection(
    slave: FacetedSurface, movable: np.ndarray, master: FacetedSurface, comm: MPI.Comm
) -> Projection:
    """Project the movable nodes, each rank every so manieth. Collective."""
    mine = np.arange(comm.rank, len(movable), comm.size)
    found: Projection | None = None
    with together(comm):
        chosen = movable[mine]
        hit = project(slave.points[chosen], slave.normals[chosen], master)
        found = replace(hit, point=mine[hit.point])
    return join([part for part in comm.allgather(found) if part is not None])
