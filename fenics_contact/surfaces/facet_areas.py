"""Areas of facets, linear and quadratic, and moments of area, with the quadrature of the load forms."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass

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
    total = np.zeros(facets.shape)
    for area, value in _at_gauss_points(points, facets):
        total += area[:, None] * value
    return total


@dataclass(frozen=True, eq=False)
class SurfaceMoments:
    """Area of a surface and its first moments.

    Attributes:
        area: A, [length²], in the plane [length].
        centroid: c = ∫ x / A, shape (dim,), [length].
        second_moment: ∫ (x − c)(x − c)ᵀ, shape (dim, dim), [length⁴], in the plane [length³].
    """

    area: float
    centroid: np.ndarray
    second_moment: np.ndarray


def surface_moments(points: np.ndarray, facets: np.ndarray) -> SurfaceMoments:
    """Return area, centroid and second moments of a surface; arguments as of `quadrature_areas`."""
    origin = points[facets[0, 0]]  # moments are as exact far from the origin of coordinates as near it
    corners = points[facets] - origin
    rule = [
        (area, np.einsum("k,nkd->nd", value, corners)) for area, value in _at_gauss_points(points, facets)
    ]
    areas, places = np.concatenate([area for area, _ in rule]), np.concatenate([place for _, place in rule])
    area = float(areas.sum())
    centre = areas @ places / area
    arms = places - centre
    return SurfaceMoments(area, origin + centre, (areas[:, None] * arms).T @ arms)


def _at_gauss_points(points: np.ndarray, facets: np.ndarray) -> Iterator[tuple[np.ndarray, np.ndarray]]:
    """Return for each Gauss point the area of it in every facet, (n_facets,), and the shape functions."""
    kind = FACET_TYPES[facets.shape[1], points.shape[1]]
    positions, weights = quadrature(kind, 2 * kind.order)  # as in load forms: resultants are exact
    values, gradients = shape_values(kind, positions), shape_gradients(kind, positions)
    corners = points[facets]
    for weight, value, gradient in zip(weights, values, gradients, strict=True):
        tangents = np.einsum("ka,nkd->nad", gradient, corners)
        normal = np.cross(tangents[:, 0], tangents[:, 1]) if points.shape[1] == 3 else tangents[:, 0]
        yield weight * np.linalg.norm(normal, axis=1), value
