"""Facets of six nodes: a pressure bears on the midpoints of their edges, hardly on their corners.

The shape functions of the corners of a quadratic triangle have the mean zero, those of the midpoints a third:
a uniform pressure makes forces at the midpoints alone. With the midpoints as points of contact, each with a
third of the facet, forces are those of a quadrature rule that is exact for quadratic displacements, and a
uniform pressure is found exactly.
"""

from __future__ import annotations

import numpy as np

from fenics_contact.mesh import FACET_TYPES, BodyMesh, CellType, shape_gradients, shape_values
from fenics_contact.surfaces.facet_areas import nodal_areas

#: The nodes of a quadratic triangle.
_CORNERS, _MIDPOINTS = slice(0, 3), slice(3, 6)


def bears_on_midpoints(facets: np.ndarray) -> bool:
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
    if bears_on_midpoints(facets):
        areas[:, _MIDPOINTS] += areas[:, _CORNERS].mean(axis=1, keepdims=True)
        areas[:, _CORNERS] = 0.0
    return areas


def bearing_pulled_back(by_areas: np.ndarray) -> np.ndarray:
    """Return the derivative by `nodal_areas` from that by `bearing_areas`, the shape of facets each."""
    if not bears_on_midpoints(by_areas):
        return by_areas
    result = by_areas.copy()
    result[:, _CORNERS] = by_areas[:, _MIDPOINTS].mean(axis=1, keepdims=True)
    return result


def share_areas(mesh: BodyMesh, name: str) -> np.ndarray:
    """Return areas by which the nodes of a surface share what is on it, (n_nodes of the mesh,), all positive.

    The nodal forces of a unit pressure; on quadratic triangles those on the linear facets between the nodes.
    """
    facets = mesh.surfaces[name]
    if bears_on_midpoints(facets):
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
    if not bears_on_midpoints(facets):
        return values
    result, corners = values.copy(), facets[:, _CORNERS]
    after = values[facets[:, _MIDPOINTS]]
    before, opposite = np.roll(after, 1, axis=1), np.roll(after, -1, axis=1)
    total, count = np.zeros_like(values), np.bincount(corners.ravel(), minlength=len(values))
    np.add.at(total, corners, 0.75 * (after + before) - 0.5 * opposite)
    mine = np.flatnonzero(count)
    result[mine] = (total[mine].T / count[mine]).T
    return result


def shape_weights(
    facets: np.ndarray, facet: np.ndarray, weights: np.ndarray
) -> tuple[np.ndarray, np.ndarray]:
    """Return the nodes of quadratic triangles and their weights at points of their linear pieces.

    Args:
        facets: Node numbers of the quadratic triangles, (n, 6).
        facet: Numbers of linear pieces, four consecutive ones a triangle, (m,).
        weights: Linear shape functions of the pieces at the points, (m, 3).

    Returns:
        Node numbers and quadratic shape functions, (m, 6) each.
    """
    kind, corners = _pieces(facet)
    places = np.einsum("mk,mkd->md", weights, corners)
    return facets[facet // len(kind.pieces)], shape_values(kind, places)


def shape_weight_gradients(facet: np.ndarray, weights: np.ndarray, gradients: np.ndarray) -> np.ndarray:
    """Return the derivatives of the weights that `shape_weights` returns by the pieces' local coordinates.

    Args:
        facet: Numbers of linear pieces, (m,).
        weights: Linear shape functions of the pieces at the points, (m, 3).
        gradients: Their derivatives, (m, 3, 2).

    Returns:
        Shape (m, 6, 2).
    """
    kind, corners = _pieces(facet)
    by_place = shape_gradients(kind, np.einsum("mk,mkd->md", weights, corners))
    return np.asarray(by_place @ np.einsum("mka,mkd->mda", gradients, corners))


def _pieces(facet: np.ndarray) -> tuple[CellType, np.ndarray]:
    """Return the type of quadratic triangles and the reference corners of pieces, (m, 3, 2)."""
    kind = FACET_TYPES[_MIDPOINTS.stop, 3]
    return kind, kind.nodes[kind.pieces[facet % len(kind.pieces)]]
