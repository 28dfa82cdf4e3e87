"""Along what rollers hold their nodes: the normal of a plane, those of a curved surface, a direction."""

from __future__ import annotations

import numpy as np

from fenics_contact._scene.fields import evaluate
from fenics_contact._scene.local_axes import HeldDirections
from fenics_contact._scene.supports import Roller
from fenics_contact._surfaces.facets import corner_products
from fenics_contact._surfaces.true_surface import true_surface, wedges_of
from fenics_contact.errors import InvalidInputError
from fenics_contact.mesh.body_mesh import BodyMesh


def held_directions(
    mesh: BodyMesh, roller: Roller, mirrored: np.ndarray, planes: np.ndarray
) -> HeldDirections:
    """Return along what a roller holds which nodes, and by how much they move.

    `mirrored`, `planes`: which nodes of the body lie on planes of symmetry, and their normals.
    """
    along = roller.directions_on(mesh)
    if along:
        nodes = mesh.nodes_to_hold(roller.surface)
        directions = np.tile(along[0], (len(nodes), 1))
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
        raise InvalidInputError(f"{name} must not be zero, got zeros at ({place}): leave out such nodes")
    return directions / size[:, None]


def _normals(
    mesh: BodyMesh, surface: str, mirrored: np.ndarray, planes: np.ndarray
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
