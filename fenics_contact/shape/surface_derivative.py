"""Reverse mode through averaged normals and nodal areas of a faceted surface."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np

from fenics_contact.surfaces import (
    FacetedSurface,
    GaussPoint,
    bearing_pulled_back,
    corner_normals,
    corner_products,
    edges_at_corners,
    gauss_points,
    slopes,
)


def normals_pulled_back(
    surface: FacetedSurface, by_normals: np.ndarray, by_averaged: np.ndarray | float = 0.0
) -> np.ndarray:
    """Vector-Jacobian product of the unit normals with respect to the surface's nodes, shape (n, dim).

    Args:
        by_normals: Derivative by each nodal normal, shape (n, dim).
        by_averaged: Direct derivative by each averaged normal, shape (n, dim).
    """
    along = np.einsum("nd,nd->n", surface.normals, by_normals)
    by_true = by_normals - along[:, None] * surface.normals
    if surface.relief is not None:
        by_true = by_true / np.linalg.norm(surface.averaged + surface.relief.normals, axis=1)[:, None]
    by_averaged = by_averaged + by_true
    products = corner_products(surface.points, surface.facets)
    summed = np.zeros_like(surface.points)
    np.add.at(summed, surface.facets, products)
    summed[surface.mirrored] = 0.0
    length = np.linalg.norm(summed, axis=1)
    along = np.einsum("nd,nd->n", surface.averaged, by_averaged)
    by_summed = (by_averaged - along[:, None] * surface.averaged) / length[:, None]
    by_summed[surface.mirrored] = 0.0
    return _products_pulled_back(surface, by_summed[surface.facets])


def slopes_pulled_back(
    surface: FacetedSurface, facet: np.ndarray, by_slopes: np.ndarray
) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Return derivatives from those by the slopes of true surfaces, see `surfaces.relief.slopes`.

    Args:
        facet: Facets, shape (n,).
        by_slopes: Derivative by the slopes at their corners, shape (n, corners, 2).

    Returns:
        By nodes, by true normals and by averaged normals, shape (n_nodes, dim) each.
    """
    by_points, by_normals, by_averaged = (np.zeros_like(surface.points) for _ in range(3))
    if surface.relief is None:
        return by_points, by_normals, by_averaged
    nodes, c, slope = surface.facets[facet], corner_normals(surface, facet), slopes(surface, facet)
    edges, along = (
        edges_at_corners(surface.points[nodes]),
        np.einsum("nkd,nkd->nk", surface.normals[nodes], c),
    )
    # s = −d·c / a·c
    scaled = by_slopes / along[:, :, None]
    by_edges = -scaled[..., None] * c[:, :, None]
    turned = np.einsum("nke,nke->nk", scaled, slope)[:, :, None]
    np.add.at(by_normals, nodes, -turned * c)
    np.add.at(
        by_averaged, nodes, -np.einsum("nke,nked->nkd", scaled, edges) - turned * surface.normals[nodes]
    )
    to_next, to_previous = by_edges[:, :, 0], by_edges[:, :, 1]
    by_corner = np.roll(to_next, 1, axis=1) + np.roll(to_previous, -1, axis=1) - to_next - to_previous
    np.add.at(by_points, nodes, by_corner)
    return by_points, by_normals, by_averaged


def areas_pulled_back(surface: FacetedSurface, by_areas: np.ndarray) -> np.ndarray:
    """Vector-Jacobian product of the nodal areas with respect to the surface's nodes, shape (n, dim).

    Args:
        by_areas: Derivative by each nodal area, shape (n,).
    """
    if surface.whole is not None:
        by_nodal = bearing_pulled_back(by_areas[surface.whole])
        return integral_pulled_back(
            surface.points, surface.whole, lambda at: (by_nodal @ at.values, np.zeros((1, 1)))
        )
    total = corner_products(surface.points, surface.facets).sum(axis=1)
    direction = total / np.linalg.norm(total, axis=1)[:, None]
    divisor = {2: 2, 3: 6, 4: 4}[surface.corners] * surface.corners
    by_total = by_areas[surface.facets].sum(axis=1)[:, None] * direction / divisor
    return _products_pulled_back(surface, np.repeat(by_total[:, None], surface.corners, axis=1))


#: Returns an integrand at a Gauss point of every facet, shape (n_facets,), and its derivative by the place.
SurfaceDensity = Callable[[GaussPoint], tuple[np.ndarray, np.ndarray]]


def integral_pulled_back(points: np.ndarray, facets: np.ndarray, density: SurfaceDensity) -> np.ndarray:
    """Return the derivative of an integral over facets by the nodes, shape (n_nodes, dim).

    Args:
        points: Coordinates, shape (n_nodes, dim), [length].
    """
    result = np.zeros_like(points)
    for at in gauss_points(points, facets):
        value, by_place = density(at)
        unit = at.normals / at.areas[:, None]
        if points.shape[1] == 3:
            first, second = at.tangents[:, 0], at.tangents[:, 1]
            by_tangents = np.stack([np.cross(second, unit), np.cross(unit, first)], axis=1)
        else:
            by_tangents = rotated_back(unit)[:, None]
        by_tangents = at.weight * value[:, None, None] * by_tangents
        by_corners = np.einsum("ka,nad->nkd", at.gradients, by_tangents)
        np.add.at(result, facets, by_corners + at.values[:, None] * (at.areas[:, None] * by_place)[:, None])
    return result


def _products_pulled_back(surface: FacetedSurface, by_products: np.ndarray) -> np.ndarray:
    """Reverse of `corner_products`: (next − x) × (previous − x) at each corner, of edges their rotation."""
    result, x = np.zeros_like(surface.points), surface.points[surface.facets]
    if surface.corners == 2:
        by_end = rotated_back(by_products.sum(axis=1))
        np.add.at(result, surface.facets, np.stack([-by_end, by_end], axis=1))
        return result
    to_next, to_previous = np.roll(x, -1, axis=1) - x, np.roll(x, 1, axis=1) - x
    # d(a × b)·c = (b × c)·da + (c × a)·db
    by_next, by_previous = np.cross(to_previous, by_products), np.cross(by_products, to_next)
    by_corner = np.roll(by_next, 1, axis=1) + np.roll(by_previous, -1, axis=1) - by_next - by_previous
    np.add.at(result, surface.facets, by_corner)
    return result


def rotated_back(vectors: np.ndarray) -> np.ndarray:
    """Return plane vectors, shape (n, 2), rotated counterclockwise: reverse of (x, y) -> (y, −x)."""
    return np.stack([-vectors[:, 1], vectors[:, 0]], axis=1)
