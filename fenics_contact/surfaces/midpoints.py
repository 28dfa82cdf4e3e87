"""Facets of six nodes: a pressure bears on the midpoints of their edges, hardly on their corners.

The shape functions of the corners of a quadratic triangle have the mean zero, those of the midpoints a third:
a uniform pressure makes forces at the midpoints alone. With the midpoints as points of contact, each with a
third of the facet, forces are those of a quadrature rule that is exact for quadratic displacements, and a
uniform pressure is found exactly.
"""

from __future__ import annotations

import numpy as np

from fenics_contact.mesh import BodyMesh
from fenics_contact.surfaces.facet_areas import nodal_areas

#: The nodes of a quadratic triangle.
_CORNERS, _MIDPOINTS = slice(0, 3), slice(3, 6)


def has_midside_pressure(facets: np.ndarray) -> bool:
    """Return whether facets are quadratic triangles, (n, 6)."""
    return facets.shape[1] == _MIDPOINTS.stop


def bearing_areas(points: np.ndarray, facets: np.ndarray) -> np.ndarray:
    """Return the area of each facet that bears on each of its nodes.

    It is the nodal force of a unit pressure, but that of the corners of quadratic triangles, which vanishes
    on flat ones, is shared by their midpoints.

    Returns:
        Shape (n_facets, nodes of a facet), [length²] or [length].
    """
    areas = nodal_areas(points, facets)
    if has_midside_pressure(facets):
        areas[:, _MIDPOINTS] += areas[:, _CORNERS].mean(axis=1, keepdims=True)
        areas[:, _CORNERS] = 0.0
    return areas


def bearing_pulled_back(by_areas: np.ndarray) -> np.ndarray:
    """Vector-Jacobian product of `bearing_areas` with respect to `nodal_areas`, the shape of facets."""
    if not has_midside_pressure(by_areas):
        return by_areas
    result = by_areas.copy()
    result[:, _CORNERS] = by_areas[:, _MIDPOINTS].mean(axis=1, keepdims=True)
    return result


def share_areas(mesh: BodyMesh, name: str) -> np.ndarray:
    """Return areas by which the nodes of a surface share what is on it, (n_nodes of the mesh,), all positive.

    The nodal forces of a unit pressure; on quadratic triangles those on the linear facets between the nodes.
    """
    facets = mesh.surfaces[name]
    if has_midside_pressure(facets):
        facets = mesh.linear.surfaces[name]
    return np.bincount(facets.ravel(), nodal_areas(mesh.points, facets).ravel(), minlength=mesh.n_nodes)


def filled_at_corners(facets: np.ndarray, values: np.ndarray) -> np.ndarray:
    """Fill in values at the corners of quadratic triangles from those at the midpoints.

    At each corner the mean over the facets around it of ¾ (a + b) − ½ c, where a and b are the values at the
    midpoints beside it and c is that opposite: between the mean beside it and the linear function through all
    three, so that quadratic fields on regular meshes are exact.

    Args:
        facets: Node numbers, (n, nodes of a facet); values stay as they are unless there are six.
        values: Values at nodes, (n_nodes,) or (n_nodes, k).

    Returns:
        The same with values at the corners.
    """
    if not has_midside_pressure(facets):
        return values
    result, corners = values.copy(), facets[:, _CORNERS]
    after = values[facets[:, _MIDPOINTS]]
    before, opposite = np.roll(after, 1, axis=1), np.roll(after, -1, axis=1)
    total, count = np.zeros_like(values), np.bincount(corners.ravel(), minlength=len(values))
    np.add.at(total, corners, 0.75 * (after + before) - 0.5 * opposite)
    mine = np.flatnonzero(count)
    result[mine] = (total[mine].T / count[mine]).T
    return result
