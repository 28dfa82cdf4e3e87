"""Contact points of a scene: which slave node meets the master where, in which direction, how far away."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

import numpy as np
import scipy.sparse as sp
from mpi4py import MPI

from fenics_contact.errors import InvalidInputError, together
from fenics_contact.feti.contact_points import ContactPoints, join_points, tangent_frames
from fenics_contact.feti.copies import Tearing
from fenics_contact.feti.projection import Projection, join, project
from fenics_contact.feti.surface import FacetedSurface, faceted_surface, shape_functions
from fenics_contact.scene import ContactPair, RigidObstacle, Scene, Surface, Tie

#: Penetration of the start geometry that faceting explains, relative to the size of a slave facet.
FACETING = 0.1


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
    """Return a named surface with its averaged normals."""
    return faceted_surface(scene.bodies[surface.body].mesh.points, scene.facets(surface))


def _points_of_pairs(
    scene: Scene, pairs: Sequence[ContactPair | Tie], tearing: Tearing, fixed: np.ndarray, comm: MPI.Comm
) -> ContactPoints:
    parts = []
    for index, pair in enumerate(pairs):
        slave = surface_of(scene, pair.slave)
        nodes = tearing.global_nodes(pair.slave.body, slave.nodes)
        movable = ~fixed[nodes].all(axis=1)
        points = _points_of_pair(scene, pair, slave, movable, tearing, comm)
        if points.count == 0:
            raise InvalidInputError(
                f"{type(pair).__name__} {index} needs slave nodes that face the master, but none of the "
                f"{np.count_nonzero(movable)} movable nodes of {pair.slave.name!r} meets it: check the "
                "surfaces' names and where the bodies lie"
            )
        parts.append(replace(points, pair=np.full(points.count, index)))
    return join_points(parts, scene.dim, len(fixed))


def _points_of_pair(
    scene: Scene,
    pair: ContactPair | Tie,
    slave: FacetedSurface,
    movable: np.ndarray,
    tearing: Tearing,
    comm: MPI.Comm,
) -> ContactPoints:
    """Return the points of one pair, ``pair`` not yet numbered. Collective."""
    nodes = tearing.global_nodes(pair.slave.body, slave.nodes)
    if not isinstance(pair.master, Surface):
        return _on_obstacle(slave, np.flatnonzero(movable), nodes, pair.master, tearing.n_nodes)
    master = surface_of(scene, pair.master)
    master_nodes = tearing.global_nodes(pair.master.body, master.nodes)
    find = _by_mortar if pair.discretisation == "mortar" else _by_projection
    return find(slave, movable, nodes, master, master_nodes, tearing.n_nodes, comm)


def _by_projection(
    slave: FacetedSurface,
    movable: np.ndarray,
    nodes: np.ndarray,
    master: FacetedSurface,
    master_nodes: np.ndarray,
    n_nodes: int,
    comm: MPI.Comm,
) -> ContactPoints:
    """Let each slave node meet the master facet that it projects on. Collective."""
    candidates = np.flatnonzero(movable)
    hit = _shared_projection(slave, candidates, master, comm)
    values, _ = shape_functions(hit.local, master.corners)
    corners = master_nodes[master.facets[hit.facet]]
    row = np.repeat(np.arange(len(hit.point)), master.corners)
    weight = sp.csr_matrix((values.ravel(), (row, corners.ravel())), shape=(len(hit.point), n_nodes))
    chosen = candidates[hit.point]
    return ContactPoints(
        np.zeros(len(chosen), dtype=np.int64), nodes[chosen], weight, hit.normal, tangent_frames(hit.normal),
        hit.gap, slave.areas[chosen], hit.facet, hit.local,
    )  # fmt: skip


def _by_mortar(
    slave: FacetedSurface,
    movable: np.ndarray,
    nodes: np.ndarray,
    master: FacetedSurface,
    master_nodes: np.ndarray,
    n_nodes: int,
    comm: MPI.Comm,
) -> ContactPoints:
    """Let each slave node meet the mean of the master under its dual basis function. Collective."""
    from fenics_contact.feti.mortar import mortar_coupling  # not before a pair asks for it

    found = mortar_coupling(slave, master, comm)
    kept = np.flatnonzero(movable[found.node])
    spread = sp.csr_matrix(
        (np.ones(len(master_nodes)), (np.arange(len(master_nodes)), master_nodes)),
        shape=(len(master_nodes), n_nodes),
    )
    normal = found.normal[kept]
    return ContactPoints(
        np.zeros(len(kept), dtype=np.int64), nodes[found.node[kept]], (found.weight[kept] @ spread).tocsr(),
        normal, tangent_frames(normal), found.gap[kept], found.area[kept], np.full(len(kept), -1),
        np.zeros((len(kept), normal.shape[1] - 1)),
    )  # fmt: skip


def _on_obstacle(
    slave: FacetedSurface, movable: np.ndarray, nodes: np.ndarray, obstacle: RigidObstacle, n_nodes: int
) -> ContactPoints:
    """Let each slave node that faces a rigid obstacle meet it."""
    normals = obstacle.normals(slave.points[movable])
    facing = np.einsum("nd,nd->n", slave.normals[movable], normals) < 0
    chosen, normals = movable[facing], normals[facing]
    count = len(chosen)
    return ContactPoints(
        np.zeros(count, dtype=np.int64), nodes[chosen], sp.csr_matrix((count, n_nodes)), normals,
        tangent_frames(normals), obstacle.distance(slave.points[chosen]), slave.areas[chosen],
        np.full(count, -1), np.zeros((count, slave.points.shape[1] - 1)),
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


def check_no_penetration(scene: Scene, points: ContactPoints) -> None:
    """Refuse a start geometry whose bodies overlap by more than their faceting explains.

    Raises:
        InvalidInputError: Names the pair, the number of nodes and the depth.
    """
    size = points.area ** (1.0 / (scene.dim - 1))
    allowed = -FACETING * size
    deep = points.gap < allowed
    if deep.any():
        worst = int(np.argmin(points.gap))
        pair = scene.contacts[int(points.pair[worst])]
        raise InvalidInputError(
            f"bodies must not overlap at the start: {int(deep.sum())} nodes of {pair.slave.body!r} lie up to "
            f"{-points.gap[worst]:.3g} inside the master, more than the faceting of the surfaces explains "
            f"({-allowed[worst]:.3g}): move the bodies apart"
        )
