"""Areas of facets, linear and quadratic, and moments of area, with the quadrature of the load forms."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass
from functools import cached_property

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
    for at in gauss_points(points, facets):
        total += at.areas[:, None] * at.values
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
    rule = [(at.areas, np.einsum("k,nkd->nd", at.values, corners)) for at in gauss_points(points, facets)]
    areas, places = np.concatenate([area for area, _ in rule]), np.concatenate([place for _, place in rule])
    area = float(areas.sum())
    centre = areas @ places / area
    arms = places - centre
    return SurfaceMoments(area, origin + centre, (areas[:, None] * arms).T @ arms)


@dataclass(frozen=True, eq=False)
class GaussPoint:
    """One point of a quadrature rule in every facet.

    Attributes:
        weight: Its weight in the reference facet.
        values: Shape functions, shape (nodes of a facet,).
        gradients: Their derivatives by the reference coordinates, shape (nodes of a facet, dim − 1).
        tangents: Derivatives of the place by these, shape (n_facets, dim − 1, dim), [length].
    """

    weight: float
    values: np.ndarray
    gradients: np.ndarray
    tangents: np.ndarray

    @cached_property
    def normals(self) -> np.ndarray:
        """Outward normals times the area that belongs to the point, shape (n_facets, dim)."""
        if self.tangents.shape[2] == 3:
            return np.asarray(self.weight * np.cross(self.tangents[:, 0], self.tangents[:, 1]))
        along = self.tangents[:, 0]
        return np.asarray(self.weight * np.stack([along[:, 1], -along[:, 0]], axis=1))

    def of(self, nodal: np.ndarray, facets: np.ndarray) -> np.ndarray:
        """Return nodal vectors, or the coordinates, at the point in every facet, shape (n_facets, dim)."""
        return np.asarray(np.einsum("k,nkd->nd", self.values, nodal[facets]))

    @cached_property
    def areas(self) -> np.ndarray:
        """The area that belongs to the point, shape (n_facets,), [length²] or [length]."""
        return np.asarray(np.linalg.norm(self.normals, axis=1))


def gauss_points(points: np.ndarray, facets: np.ndarray) -> Iterator[GaussPoint]:
    """Return the points of a quadrature rule on facets; arguments as of `quadrature_areas`."""
    kind = FACET_TYPES[facets.shape[1], points.shape[1]]
    positions, weights = quadrature(kind, 2 * kind.order)  # as in load forms: resultants are exact
    values, gradients = shape_values(kind, positions), shape_gradients(kind, positions)
    corners = points[facets]
    for weight, value, gradient in zip(weights, values, gradients, strict=True):
        yield GaussPoint(float(weight), value, gradient, np.einsum("ka,nkd->nad", gradient, corners))
