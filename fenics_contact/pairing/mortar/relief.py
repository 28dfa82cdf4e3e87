"""Heights of true surfaces over their facets, at the quadrature points of a mortar coupling."""

from __future__ import annotations

import numpy as np

from fenics_contact.pairing.mortar.cells import Cells
from fenics_contact.surfaces import FacetedSurface, heights, interpolated_normal


def relief_of_cells(
    cells: Cells,
    slave: FacetedSurface,
    master: FacetedSurface,
    pairs: tuple[np.ndarray, np.ndarray],
    along: np.ndarray,
) -> np.ndarray:
    """Return the height of the true slave over its facets less that of the master, shape (n, q), [length].

    Args:
        cells: Quadrature points.
        slave: The slave surface.
        master: The master surface.
        pairs: Slave facet and master facet of each pair, shape (n_pairs,) each.
        along: Direction of the heights for each pair, out of the slave facet, shape (n_pairs, dim).
    """
    at_slave, at_master = (facet[cells.pair] for facet in pairs)
    direction = along[cells.pair]
    own = _heights_along(slave, at_slave, cells.local, cells.slave, direction)
    return own - _heights_along(master, at_master, cells.opposite, cells.master, direction)


def _heights_along(
    surface: FacetedSurface, facet: np.ndarray, local: np.ndarray, values: np.ndarray, direction: np.ndarray
) -> np.ndarray:
    """Return heights along a direction whose angle to the normal is less than a facet's turn."""
    if surface.relief is None:
        return np.zeros(local.shape[:2])
    points = local.shape[1]
    facet, direction = np.repeat(facet, points), np.repeat(direction, points, axis=0)
    values = values.reshape(len(facet), -1)
    normal, _ = interpolated_normal(values, surface.normals[surface.facets[facet]])
    height = heights(surface, facet, local.reshape(len(facet), -1)).value
    return np.asarray(height / np.einsum("nd,nd->n", normal, direction)).reshape(local.shape[:2])
