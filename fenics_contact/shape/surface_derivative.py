"""Reverse mode through averaged normals and nodal areas of a faceted surface."""

from __future__ import annotations

import numpy as np

from fenics_contact.feti.surface import FacetedSurface, corner_products


def normals_pulled_back(surface: FacetedSurface, by_normals: np.ndarray) -> np.ndarray:
    """Return the derivative by the surface's nodes from that by its unit normals, shape (n, 3).

    Args:
        surface: The surface.
        by_normals: Derivative by each nodal normal, shape (n, 3).
    """
    products = corner_products(surface.points, surface.facets)
    summed = np.zeros_like(surface.points)
    np.add.at(summed, surface.facets, products)
    summed[surface.mirrored] = 0.0
    length = np.linalg.norm(summed, axis=1)
    along = np.einsum("nd,nd->n", surface.normals, by_normals)
    by_summed = (by_normals - along[:, None] * surface.normals) / length[:, None]
    by_summed[surface.mirrored] = 0.0
    return _products_pulled_back(surface, by_summed[surface.facets])


def areas_pulled_back(surface: FacetedSurface, by_areas: np.ndarray) -> np.ndarray:
    """Return the derivative by the surface's nodes from that by its nodal areas, shape (n, 3).

    Args:
        surface: The surface.
        by_areas: Derivative by each nodal area, shape (n,).
    """
    total = corner_products(surface.points, surface.facets).sum(axis=1)
    direction = total / np.linalg.norm(total, axis=1)[:, None]
    divisor = (4 if surface.corners == 4 else 6) * surface.corners
    by_total = by_areas[surface.facets].sum(axis=1)[:, None] * direction / divisor
    return _products_pulled_back(surface, np.repeat(by_total[:, None], surface.corners, axis=1))


def _products_pulled_back(surface: FacetedSurface, by_products: np.ndarray) -> np.ndarray:
    """Reverse of `corner_products`: (next − x) × (previous − x) at each corner."""
    x = surface.points[surface.facets]
    to_next, to_previous = np.roll(x, -1, axis=1) - x, np.roll(x, 1, axis=1) - x
    # d(a × b)·c = (b × c)·da + (c × a)·db
    by_next, by_previous = np.cross(to_previous, by_products), np.cross(by_products, to_next)
    by_corner = np.roll(by_next, 1, axis=1) + np.roll(by_previous, -1, axis=1) - by_next - by_previous
    result = np.zeros_like(surface.points)
    np.add.at(result, surface.facets, by_corner)
    return result
