"""Contact points of a scene: which slave node meets the master where, in which direction, how far away."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, fields, replace

import numpy as np
from mpi4py import MPI

from fenics_contact.errors import InvalidInputError, together
from fenics_contact.feti.copies import Tearing
from fenics_contact.feti.projection import Projection, join, project
from fenics_contact.feti.surface import FacetedSurface, faceted_surface, shape_functions
from fenics_contact.scene import ContactPair, Coulomb, RigidPlane, Scene, Surface, Tresca

#: Penetration of the start geometry that faceting explains, relative to the size of a slave facet.
FACETING = 0.1


@dataclass(frozen=True)
class ContactPoints:
    """All contact points of a scene, replicated on all ranks, in the order pair by pair, node by node.

    Attributes:
        pair: Contact pair of the scene, shape (n,).
        slave: Slave node among all bodies' nodes, shape (n,).
        master: Nodes of the master facet, shape (n, 4); weights of unused entries are zero.
        weight: Shape functions of the master facet at the projection, shape (n, 4).
        normal: Unit normal from master to slave, shape (n, 3).
        tangents: Two unit tangents, shape (n, 2, 3).
        gap: Distance along the normal, positive when open, shape (n,), [length].
        area: Area of the slave surface that belongs to the node, shape (n,), [length²].
        facet: Facet of the master surface, −1 on a rigid plane, shape (n,).
        local: Local coordinates on it, shape (n, 2).
    """

    pair: np.ndarray
    slave: np.ndarray
    master: np.ndarray
    weight: np.ndarray
    normal: np.ndarray
    tangents: np.ndarray
    gap: np.ndarray
    area: np.ndarray
    facet: np.ndarray
    local: np.ndarray

    @property
    def count(self) -> int:
        """Number of contact points."""
        return len(self.slave)


def find_contact_points(
    scene: Scene, tearing: Tearing, fixed: np.ndarray, comm: MPI.Comm = MPI.COMM_SELF
) -> ContactPoints:
    """Project the slave nodes of every pair onto its master. Collective on ``comm``.

    Each rank projects some of the nodes, and all receive all points. Nodes whose displacement is prescribed
    in all components cannot move and are left out.

    Args:
        scene: The scene.
        tearing: Node numbering.
        fixed: Whether a component of a node is prescribed, shape (n_nodes, 3).
        comm: Communicator of the ranks that share the work.

    Raises:
        InvalidInputError: If no node of a slave surface finds its master.
    """
    parts = [_points_of_pair(scene, tearing, fixed, index, comm) for index in range(len(scene.contacts))]
    joined = [np.concatenate([getattr(part, f.name) for part in parts]) for f in fields(ContactPoints)]
    return ContactPoints(*joined)


def no_contact_points() -> ContactPoints:
    """Return the empty collection, for scenes without contact."""
    integer = np.zeros(0, dtype=np.int64)
    return ContactPoints(
        integer, integer, np.zeros((0, 4), np.int64), np.zeros((0, 4)), np.zeros((0, 3)), np.zeros((0, 2, 3)),
        np.zeros(0), np.zeros(0), integer, np.zeros((0, 2)),
    )  # fmt: skip


def surface_of(scene: Scene, surface: Surface) -> FacetedSurface:
    """Return a named surface with its averaged normals."""
    return faceted_surface(scene.bodies[surface.body].mesh.points, scene.facets(surface))


def _points_of_pair(
    scene: Scene, tearing: Tearing, fixed: np.ndarray, index: int, comm: MPI.Comm
) -> ContactPoints:
    pair = scene.contacts[index]
    slave = surface_of(scene, pair.slave)
    nodes = tearing.global_nodes(pair.slave.body, slave.nodes)
    movable = np.flatnonzero(~fixed[nodes].all(axis=1))
    if isinstance(pair.master, RigidPlane):
        hit, master, weight = _on_plane(slave, movable, pair.master)
    else:
        surface = surface_of(scene, pair.master)
        hit = _shared_projection(slave, movable, surface, comm)
        values, _ = shape_functions(hit.local, surface.corners)
        weight = np.pad(values, ((0, 0), (0, 4 - surface.corners)))
        facet_nodes = tearing.global_nodes(pair.master.body, surface.nodes[surface.facets[hit.facet]])
        master = np.pad(facet_nodes, ((0, 0), (0, 4 - surface.corners)), mode="edge")
    if len(hit.point) == 0:
        raise InvalidInputError(
            f"contact pair {index} needs slave nodes that face the master, but none of the {len(movable)} "
            f"nodes of {pair.slave.name!r} projects onto it: check the surfaces' names and where the bodies "
            "lie"
        )
    chosen = movable[hit.point]
    return ContactPoints(
        np.full(len(chosen), index), nodes[chosen], master, weight, hit.normal, tangent_frames(hit.normal),
        hit.gap, slave.areas[chosen], hit.facet, hit.local,
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


def _on_plane(
    slave: FacetedSurface, movable: np.ndarray, plane: RigidPlane
) -> tuple[Projection, np.ndarray, np.ndarray]:
    normal = np.asarray(plane.normal)
    point = np.flatnonzero(slave.normals[movable] @ normal < 0)
    count = len(point)
    gap = (slave.points[movable[point]] - np.asarray(plane.point)) @ normal
    normals = np.tile(normal, (count, 1))
    hit = Projection(point, np.full(count, -1), np.zeros((count, 2)), gap, normals)
    return hit, np.zeros((count, 4), dtype=np.int64), np.zeros((count, 4))


def reference_axes(normals: np.ndarray) -> np.ndarray:
    """Return for each normal the coordinate axis that is least aligned with it, shape (n, 3)."""
    # Rounding first: symmetric geometries have ties, which must not be decided by the last bit.
    return np.eye(3)[np.argmin(np.round(np.abs(normals), 6), axis=1)]


def tangent_frames(normals: np.ndarray) -> np.ndarray:
    """Return two unit tangents for each unit normal, so that (t1, t2, n) is right-handed, shape (n, 2, 3)."""
    axes = reference_axes(normals)
    first = axes - np.einsum("nd,nd->n", axes, normals)[:, None] * normals
    first = first / np.linalg.norm(first, axis=1)[:, None]
    return np.stack([first, np.cross(normals, first)], axis=1)


def check_no_penetration(scene: Scene, points: ContactPoints) -> None:
    """Refuse a start geometry whose bodies overlap by more than their faceting explains.

    Raises:
        InvalidInputError: Names the pair, the number of nodes and the depth.
    """
    allowed = -FACETING * np.sqrt(points.area)
    deep = points.gap < allowed
    if deep.any():
        worst = int(np.argmin(points.gap))
        pair = scene.contacts[int(points.pair[worst])]
        raise InvalidInputError(
            f"bodies must not overlap at the start: {int(deep.sum())} nodes of {pair.slave.body!r} lie up to "
            f"{-points.gap[worst]:.3g} inside the master, more than the faceting of the surfaces explains "
            f"({-allowed[worst]:.3g}): move the bodies apart"
        )


def friction_data(
    pairs: Sequence[ContactPair], points: ContactPoints
) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Return what friction each contact point has.

    Returns:
        Whether it has friction, shape (n,); its Coulomb coefficient (zero under Tresca), shape (n,); its
        Tresca bound as a nodal force (zero under Coulomb), shape (n,), [force].
    """
    has = np.array([pair.has_friction for pair in pairs], dtype=bool)
    laws = [pair.friction for pair in pairs]
    coefficient = np.array([law.friction_coefficient if isinstance(law, Coulomb) else 0.0 for law in laws])
    traction = np.array([law.traction if isinstance(law, Tresca) else 0.0 for law in laws])
    if len(pairs) == 0:
        return np.zeros(0, dtype=bool), np.zeros(0), np.zeros(0)
    return has[points.pair], coefficient[points.pair], traction[points.pair] * points.area
