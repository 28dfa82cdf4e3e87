"""Layers of the master behind one another, closer than the size of facets: only the nearest one counts."""

from __future__ import annotations

import numpy as np
from scipy.spatial import cKDTree

from fenics_contact.pairing.mortar.clipping import clip
from fenics_contact.pairing.mortar.planes import measure

#: Fraction of a slave facet's area that must be covered twice for layers to be searched.
TWICE = 1e-6


def hidden(
    vertices: np.ndarray, count: np.ndarray, height: np.ndarray, facet: np.ndarray, area: np.ndarray
) -> np.ndarray:
    """Return which pieces of the master lie behind nearer ones, seen from the same slave facet.

    A partly hidden piece counts as hidden.

    Args:
        vertices: Pieces in the planes of the slave facets, as `clip` returns them, shape (n, k, dim − 1).
        count: Their numbers of vertices, shape (n,).
        height: Mean heights above the plane, shape (n,), [length].
        facet: Slave facet of each piece, shape (n,).
        area: Area (length) of the slave facets, shape (n_facets,).

    Returns:
        Whether a piece is hidden, shape (n,).
    """
    behind = np.zeros(len(vertices), dtype=bool)
    if vertices.shape[1] < 2:
        return behind
    size = _area(vertices, count)
    covered = np.bincount(facet, weights=size, minlength=len(area))
    crowded = np.flatnonzero((covered > (1 + TWICE) * area)[facet] & (size > 0))
    if len(crowded) == 0:
        return behind
    far, near = _neighbours(vertices[crowded], height[crowded], facet[crowded])
    shared = _area(*clip(vertices[crowded[far]], vertices[crowded[near]]))
    smaller = np.minimum(size[crowded[far]], size[crowded[near]])
    behind[crowded[far[shared > TWICE * smaller]]] = True
    return behind


def _neighbours(vertices: np.ndarray, height: np.ndarray, facet: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Pair pieces of the same slave facet that may overlap, the further one first."""
    centre = vertices.mean(axis=1)
    reach = 2 * np.linalg.norm(vertices - centre[:, None], axis=2).max()
    # Facets are separated in an additional coordinate, too far apart to overlap.
    places = np.column_stack([centre, 2 * reach * facet])
    pairs = cKDTree(places).query_pairs(reach, output_type="ndarray")
    further = np.abs(height[pairs[:, 0]]) > np.abs(height[pairs[:, 1]])
    return np.where(further, pairs[:, 0], pairs[:, 1]), np.where(further, pairs[:, 1], pairs[:, 0])


def _area(vertices: np.ndarray, count: np.ndarray) -> np.ndarray:
    """Return the areas (lengths) of pieces, zero for empty ones, shape (n,)."""
    if vertices.shape[1] < 2:
        return np.zeros(len(vertices))
    return np.where(count > 0, np.abs(measure(vertices)), 0.0)
