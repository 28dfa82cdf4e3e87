"""Surfaces of bodies where they lie now, with their averaged normals and the derivatives of these."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import scipy.sparse as sp

from fenics_contact.surfaces import FacetedSurface, corner_products


def summed_normals(surface: FacetedSurface, points: np.ndarray) -> np.ndarray:
    """Return the sums of the area vectors around nodes, within planes of symmetry, shape (n, dim), [length²].

    Args:
        surface: The surface in the reference configuration.
        points: Present coordinates of its nodes, shape (n, dim), [length].
    """
    summed = np.zeros_like(points)
    np.add.at(summed, surface.facets, corner_products(points, surface.facets))
    summed[surface.mirrored] = 0.0
    return summed


def moved_surface(surface: FacetedSurface, points: np.ndarray) -> FacetedSurface:
    """Return a surface in its present place, made of its facets. Areas stay those of the reference.

    Args:
        surface: The surface in the reference configuration.
        points: Present coordinates of its nodes, shape (n, dim), [length].
    """
    summed = summed_normals(surface, points)
    length = np.linalg.norm(summed, axis=1)
    averaged = summed / np.where(length > 0.0, length, 1.0)[:, None]
    return replace(surface, points=points, averaged=averaged, relief=None)


def summed_normals_by_points(surface: FacetedSurface, along: np.ndarray) -> sp.csr_matrix:
    """Return v·δN for the sums N of `summed_normals` and given vectors v, shape (n, n · dim).

    Args:
        surface: The surface in its present place.
        along: v, zero in components that planes of symmetry take away, shape (n, dim).
    """
    facets, dim = surface.facets, surface.dim
    corners, v = surface.points[facets], along[facets]
    if dim == 2:
        # Both ends of an edge d have the product (d_y, −d_x).
        turned = np.stack([-v[:, :, 1], v[:, :, 0]], axis=2)
        ends = (np.broadcast_to(facets[:, end, None], facets.shape) for end in (0, 1))
        parts = list(zip(ends, (-turned, turned), strict=True))
    else:
        ahead, behind = np.roll(corners, -1, axis=1) - corners, np.roll(corners, 1, axis=1) - corners
        by_ahead, by_behind = np.cross(behind, v), np.cross(v, ahead)
        parts = [
            (np.roll(facets, -1, axis=1), by_ahead),
            (np.roll(facets, 1, axis=1), by_behind),
            (facets, -by_ahead - by_behind),
        ]
    row = np.tile(np.repeat(facets.ravel(), dim), len(parts))
    column = np.concatenate([(dim * node[..., None] + np.arange(dim)).ravel() for node, _ in parts])
    value = np.concatenate([part.ravel() for _, part in parts])
    size = len(surface.nodes)
    return sp.csr_matrix((value, (row, column)), shape=(size, dim * size))
