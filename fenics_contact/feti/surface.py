"""Faceted surfaces with a continuous normal field: shape functions, averaged nodal normals, nodal areas."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np


def shape_functions(local: np.ndarray, corners: int) -> tuple[np.ndarray, np.ndarray]:
    """Evaluate the shape functions of facets with 4 (bilinear) or 3 (linear) corners.

    Args:
        local: Local coordinates, shape (n, 2), in [−1, 1]² for quadrilaterals, in the unit triangle else.
        corners: 4 or 3.

    Returns:
        Values, shape (n, corners), and derivatives, shape (n, corners, 2).
    """
    s, t = local[:, 0], local[:, 1]
    if corners == 3:
        values = np.stack([1 - s - t, s, t], axis=1)
        return values, np.broadcast_to(np.array([[-1.0, -1.0], [1.0, 0.0], [0.0, 1.0]]), (len(s), 3, 2))
    a, b = np.array([-1.0, 1.0, 1.0, -1.0]), np.array([-1.0, -1.0, 1.0, 1.0])
    u, v = 1 + a * s[:, None], 1 + b * t[:, None]
    return 0.25 * u * v, 0.25 * np.stack([a * v, u * b], axis=2)


def shape_second_mixed(corners: int) -> np.ndarray:
    """Return ∂²N/∂s∂t of each shape function, the only second derivative not zero, shape (corners,)."""
    return 0.25 * np.array([1.0, -1.0, 1.0, -1.0]) if corners == 4 else np.zeros(3)


def outside(local: np.ndarray, corners: int) -> np.ndarray:
    """Return by how much local coordinates lie outside the facet, shape (n,); zero inside."""
    s, t = local[:, 0], local[:, 1]
    if corners == 4:
        return np.maximum(np.maximum(np.abs(s), np.abs(t)) - 1, 0)
    return np.maximum(np.maximum.reduce([-s, -t, s + t - 1]), 0)


def edge_distance(local: np.ndarray, corners: int) -> np.ndarray:
    """Return how far points inside a facet are from its edges, in local coordinates, shape (n,)."""
    s, t = local[:, 0], local[:, 1]
    if corners == 4:
        return 1 - np.maximum(np.abs(s), np.abs(t))
    return np.minimum.reduce([s, t, 1 - s - t])


def corner_products(points: np.ndarray, facets: np.ndarray) -> np.ndarray:
    """Return the cross product of the two edges at each corner, outward, shape (n_facets, corners, 3)."""
    x = points[facets]
    return np.cross(np.roll(x, -1, axis=1) - x, np.roll(x, 1, axis=1) - x)


@dataclass(frozen=True)
class FacetedSurface:
    """Facets with the unit normals of their nodes, averaged over the facets around each.

    The normal field interpolated between the nodes is continuous across facets, unlike the facets' own.

    Attributes:
        nodes: Nodes of the body on this surface, ascending, shape (n,).
        facets: Facets as rows of positions in ``nodes``, cyclic order, shape (n_facets, 3 or 4).
        points: Coordinates of the nodes, shape (n, 3), [length].
        normals: Outward unit normals at the nodes, shape (n, 3).
        areas: Area that belongs to each node, shape (n,), [length²].
    """

    nodes: np.ndarray
    facets: np.ndarray
    points: np.ndarray
    normals: np.ndarray
    areas: np.ndarray

    @property
    def corners(self) -> int:
        """Corners of a facet: 3 or 4."""
        return int(self.facets.shape[1])


def faceted_surface(points: np.ndarray, facets: np.ndarray) -> FacetedSurface:
    """Build the surface from the coordinates of a body and rows of its node numbers."""
    nodes, local = np.unique(facets, return_inverse=True)
    local = local.reshape(facets.shape)
    own = points[nodes]
    products = corner_products(own, local)
    summed = np.zeros_like(own)
    np.add.at(summed, local, products)
    areas = np.zeros(len(nodes))
    # The corner products of a quadrilateral add up to four times its area vector, those of a triangle to six.
    share = (
        np.linalg.norm(products.sum(axis=1), axis=1) / (4 if facets.shape[1] == 4 else 6) / facets.shape[1]
    )
    np.add.at(areas, local, np.broadcast_to(share[:, None], local.shape))
    return FacetedSurface(nodes, local, own, summed / np.linalg.norm(summed, axis=1)[:, None], areas)


def quadrature_areas(points: np.ndarray, facets: np.ndarray) -> np.ndarray:
    """Return facet areas by two Gauss points a direction, as the load forms integrate, shape (n_facets,)."""
    if facets.shape[1] == 3:
        return 0.5 * np.linalg.norm(corner_products(points, facets)[:, 0], axis=1)
    corners, total = points[facets], np.zeros(len(facets))
    for s in (-1 / np.sqrt(3), 1 / np.sqrt(3)):
        for t in (-1 / np.sqrt(3), 1 / np.sqrt(3)):
            _, derivatives = shape_functions(np.array([[s, t]]), 4)
            tangents = np.einsum("ka,nkd->nda", derivatives[0], corners)
            total += np.linalg.norm(np.cross(tangents[:, :, 0], tangents[:, :, 1]), axis=1)
    return total
