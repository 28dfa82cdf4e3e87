"""Along what rollers hold their nodes: the normal of a plane, those of a curved surface, a direction."""

from __future__ import annotations

import numpy as np

from fenics_contact._scene.body import Body
from fenics_contact._scene.fields import evaluate
from fenics_contact._scene.local_axes import HeldDirections
from fenics_contact._scene.supports import Roller
from fenics_contact._surfaces.facets import corner_products
from fenics_contact._surfaces.true_surface import true_surface, wedges_of
from fenics_contact.errors import InvalidInputError
from fenics_contact.mesh.body_mesh import BodyMesh
from fenics_contact.mesh.faces import vector_areas


def flat_normal(mesh: BodyMesh, surface: str, flat: float = 1e-6) -> np.ndarray | None:
    """Return the outward normal of a flat surface, shape (dim,), None of a curved one and of a node set.

    `flat`: distance of nodes from a plane, relative to the size of the surface, up to which it is flat:
    coordinates of files have few digits.
    """
    if surface in mesh.node_sets:
        return None
    facets = mesh.surfaces[surface]
    areas = vector_areas(mesh.points, facets)
    total = areas.sum(axis=0)
    size = np.linalg.norm(areas, axis=1).sum()
    if np.linalg.norm(total) <= 0.5 * size:
        return None
    normal = total / np.linalg.norm(total)
    points = mesh.points[np.unique(facets)]
    away = (points - points[0]) @ normal
    if np.ptp(away) > flat * np.linalg.norm(np.ptp(points, axis=0)) or (areas @ normal <= 0.0).any():
        return None
    return np.asarray(normal)


def widest_angle(mesh: BodyMesh, surface: str) -> float:
    """Return the largest angle between the normals of facets and their mean, in degrees."""
    areas = vector_areas(mesh.points, mesh.surfaces[surface])
    mean = areas.sum(axis=0)
    size = np.linalg.norm(areas, axis=1) * np.linalg.norm(mean)
    cosine = np.where(size > 0.0, areas @ mean, -1.0) / np.where(size > 0.0, size, 1.0)
    return float(np.degrees(np.arccos(np.clip(cosine.min(), -1.0, 1.0))))


def require_direction(body: Body, roller: Roller) -> None:
    """Reject a direction in another space, and ones that differ where bodies deform much."""
    mesh, given = body.mesh, roller.direction
    where = f"{roller.surface!r} of body {roller.body!r}"
    if roller.surface in mesh.node_sets and given is None:
        raise InvalidInputError(
            f"a roller on nodes needs a direction, node set {where} has no normal: give one"
        )
    if given is not None and not callable(given) and len(given) != mesh.dim:
        raise InvalidInputError(
            f"Roller.direction of surface {where} must have {mesh.dim} components, got {given!r}: give "
            f"{mesh.dim} of them, or none for the normal"
        )
    if body.deforms_much and direction_of(mesh, roller) is None:
        raise InvalidInputError(
            f"a roller on a body that deforms much needs one direction, but surface {where} is curved, its "
            f"normals turn by up to {widest_angle(mesh, roller.surface):.3g} degrees: give the roller a "
            "direction, or hold the surface by a RigidObstacle and contact"
            if given is None
            else f"a roller on a body that deforms much needs one direction, that of {where} is a function: "
            "give a vector"
        )


def direction_of(mesh: BodyMesh, roller: Roller) -> np.ndarray | None:
    """Return the one direction along which a roller holds its nodes, shape (dim,); None where they differ."""
    if callable(roller.direction):
        return None
    if roller.direction is not None:
        return np.array(roller.direction)
    return flat_normal(mesh, roller.surface)


def held_directions(
    mesh: BodyMesh, roller: Roller, mirrored: np.ndarray, planes: np.ndarray | None
) -> HeldDirections:
    """Return along what a roller holds which nodes, and by how much they move.

    `mirrored`, `planes`: which nodes of the body lie on planes of symmetry, and their normals.
    """
    direction = direction_of(mesh, roller)
    if direction is not None:
        nodes = mesh.nodes_to_hold(roller.surface)
        directions = np.tile(direction, (len(nodes), 1))
    elif callable(roller.direction):
        nodes = mesh.nodes_to_hold(roller.surface)
        directions = _given(roller, mesh.points[nodes])
    else:
        nodes, directions = _normals(mesh, roller.surface, mirrored, planes)
        firm = np.isin(nodes, mesh.nodes_to_hold(roller.surface))
        nodes, directions = nodes[firm], directions[firm]
    return HeldDirections(roller.surface, nodes, directions, roller.amounts(mesh.points[nodes]))


def _given(roller: Roller, points: np.ndarray) -> np.ndarray:
    """Return the directions that a function gives at points, of unit length."""
    name = f"the direction of the roller on {roller.surface!r} of body {roller.body!r}"
    assert callable(roller.direction)
    directions = evaluate(name, roller.direction, points, (points.shape[1],))
    size = np.linalg.norm(directions, axis=1)
    if not size.all():
        place = ", ".join(f"{x:.6g}" for x in points[int(np.argmin(size))])
        raise InvalidInputError(
            f"{name} must not be zero, got zeros at ({place}): leave out nodes without one"
        )
    return directions / size[:, None]


def _normals(
    mesh: BodyMesh, surface: str, mirrored: np.ndarray, planes: np.ndarray | None
) -> tuple[np.ndarray, np.ndarray]:
    """Return nodes of a curved surface and unit normals there, on an edge of it one of either side."""
    faceted = true_surface(mesh, surface, "best", mirrored=mirrored, planes=planes)
    wedges = wedges_of(faceted)
    count = len(wedges.node)
    normals = np.zeros((count, mesh.dim))
    corners = corner_products(faceted.points, faceted.facets)
    if faceted.relief is not None:
        corners = faceted.averaged[faceted.facets] + faceted.relief.corners
    np.add.at(normals, wedges.of_corner, corners)
    normals = faceted.within(normals, wedges.mirrored)
    return faceted.nodes[wedges.node], normals / np.linalg.norm(normals, axis=1)[:, None]
