"""Areas of facets, linear and quadratic, with the quadrature of the load forms."""

from __future__ import annotations

import numpy as np

from fenics_contact.mesh import FACET_TYPES, quadrature, shape_gradients, shape_values


def quadrature_areas(points: np.ndarray, facets: np.ndarray) -> np.ndarray:
    """Return the areas of facets, in the plane the lengths of edges.

    Args:
        points: Coordinates, shape (n_nodes, 3 or 2), [length].
        facets: Node numbers as in `BodyMesh.surfaces`, shape (n_facets, nodes of a facet).

    Returns:
        Shape (n_facets,), [length²] or [length].
    """
    return np.asarray(nodal_areas(points, facets).sum(axis=1), dtype=np.float64)


def nodal_areas(points: np.ndarray, facets: np.ndarray) -> np.ndarray:
    """Integrate the shape functions over every facet: nodal forces of a unit pressure.

    Two Gauss points per direction on linear facets, three on quadratic ones.

    Returns:
        Shape (n_facets, nodes of a facet), [length²] or [length].
    """
    kind = FACET_TYPES[facets.shape[1], points.shape[1]]
    positions, weights = quadrature(kind)
    values, gradients = shape_values(kind, positions), shape_gradients(kind, positions)
    corners = points[facets]
    total = np.zeros(facets.shape)
    for weight, value, gradient in zip(weights, values, gradients, strict=True):
        tangents = np.einsum("ka,nkd->nad", gradient, corners)
        normal = np.cross(tangents[:, 0], tangents[:, 1]) if points.shape[1] == 3 else tangents[:, 0]
        total += weight * np.linalg.norm(normal, axis=1)[:, None] * value
    return total
