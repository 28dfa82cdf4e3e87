"""Along what rollers hold their nodes: the normal of a plane, those of a curved surface, a direction."""

from __future__ import annotations

import numpy as np

from fenics_contact._scene.local_axes import HeldDirections
from fenics_contact._scene.supports import Roller
from fenics_contact._surfaces.facets import corner_products
from fenics_contact._surfaces.true_surface import true_surface, wedges_of
from fenics_contact.mesh.body_mesh import BodyMesh
from fenics_contact.mesh.faces import vector_areas


def flat_normal(mesh: BodyMesh, surface: str, flat: float = 1e-6) -> np.ndarray | None:
    """Return the outward normal of a flat surface, shape (dim,), None where it is curved.

    `flat`: distance of nodes from a plane, relative to the size of the surface, up to which it is flat:
    coordinates of files have few digits.
    """
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


def direction_of(mesh: BodyMesh, roller: Roller) -> np.ndarray | None:
    """Return the one direction along which a roller holds its nodes, shape (dim,); None if it is curved."""
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
    else:
        nodes, directions = _normals(mesh, roller.surface, mirrored, planes)
        firm = np.isin(nodes, mesh.nodes_to_hold(roller.surface))
        nodes, directions = nodes[firm], directions[firm]
    return HeldDirections(roller.surface, nodes, directions, roller.amounts(mesh.points[nodes]))


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
