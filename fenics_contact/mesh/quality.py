"""Jacobians, volumes and shape quality of cells, for all cells at once.

Points with three coordinates belong to hexahedra or tetrahedra, points with two to quadrilaterals or
triangles, for which "volume" is the area.
"""

from __future__ import annotations

import numpy as np

from fenics_contact.mesh.cell_types import CellType, cell_type_of
from fenics_contact.mesh.shape_functions import quadrature, shape_gradients
from fenics_contact.surface_shapes import tensor_grid

HEXAHEDRON_LATTICE = tensor_grid(3 * [[0.0, 0.5, 1.0]])
"""Vertices, edge and face midpoints and centre: points at which the Jacobian of a hexahedron is evaluated.

The determinant is quadratic in each coordinate, so these 27 values determine it everywhere."""

FLAT = 1e-14
"""A Jacobian below this fraction of the bounding box's diagonal to the power of the dimension is rounding."""

_BEST_CORNER = {3: np.sqrt(2.0), 2: 2.0 / np.sqrt(3.0)}
"""One over the corner determinant of unit edge vectors in a regular simplex, by dimension."""


def determinants(matrices: np.ndarray) -> np.ndarray:
    """Compute 3 x 3 or 2 x 2 determinants of a stack, (..., d, d) to (...)."""
    a, b = matrices[..., 0, :], matrices[..., 1, :]
    if matrices.shape[-1] == 2:
        return np.asarray(a[..., 0] * b[..., 1] - a[..., 1] * b[..., 0])
    c = matrices[..., 2, :]
    return np.asarray(
        a[..., 0] * (b[..., 1] * c[..., 2] - b[..., 2] * c[..., 1])
        + a[..., 1] * (b[..., 2] * c[..., 0] - b[..., 0] * c[..., 2])
        + a[..., 2] * (b[..., 0] * c[..., 1] - b[..., 1] * c[..., 0])
    )


def _critical_positions(cell: CellType) -> np.ndarray:
    """Points at which the Jacobian is evaluated.

    That of a quadrilateral is linear and determined by its vertices; that of a hexahedron by the lattice. On
    quadratic cells, where no small set of values bounds it, it is evaluated at the nodes and the Gauss
    points.
    """
    if cell.order == 2:
        return np.concatenate([cell.nodes, quadrature(cell)[0]])
    return HEXAHEDRON_LATTICE if cell.dim == 3 else cell.vertices


def jacobians(points: np.ndarray, cells: np.ndarray, positions: np.ndarray | None = None) -> np.ndarray:
    """Evaluate the Jacobian determinant of the map from the reference cell.

    Args:
        points: Coordinates, (n_nodes, 3 | 2).
        cells: Node numbers, (n_cells, nodes of a cell).
        positions: Reference coordinates, (m, 3 | 2), for all but linear simplices; unless given the 27 points
            of `HEXAHEDRON_LATTICE`, the four vertices, or nodes and Gauss points of quadratic cells. A linear
            simplex has one constant Jacobian: six times its volume, or twice its area.

    Returns:
        (n_cells, m), or (n_cells, 1) for linear simplices, in units of volume (area).
    """
    cell = cell_type_of(cells, points.shape[1])
    corners = points[cells]
    if cell.is_affine:
        return determinants(corners[:, 1:] - corners[:, :1])[:, None]
    if positions is None:
        positions = _critical_positions(cell)
    columns = np.ascontiguousarray(corners.transpose(0, 2, 1)).reshape(-1, cells.shape[1])
    values = np.empty((cells.shape[0], positions.shape[0]))
    # A few positions, all cells at once, which keeps the arrays small.
    for m, gradients in enumerate(shape_gradients(cell, positions)):
        values[:, m] = determinants((columns @ gradients).reshape(-1, cell.dim, cell.dim))
    return values


def jacobian_ratio(points: np.ndarray, cells: np.ndarray) -> np.ndarray:
    """Return the ratio of the smallest to the largest Jacobian in every cell.

    Returns:
        (n_cells,) values in [-1, 1]: 1 for a parallelepiped, a parallelogram or a proper simplex, 0 or less
        where the cell is degenerate or inverted.
    """
    values = jacobians(points, cells)
    largest = np.maximum(np.abs(values).max(axis=1), np.finfo(float).tiny)
    return np.asarray(values.min(axis=1) / largest)


def scaled_jacobian(points: np.ndarray, cells: np.ndarray) -> np.ndarray:
    """Compute the smallest corner determinant of the unit edge vectors of every cell.

    For simplices it is scaled such that the regular one has 1.

    Returns:
        (n_cells,) values in [-1, 1]: 1 for a box or a regular simplex, 0 or less where inverted.
    """
    cell = cell_type_of(cells, points.shape[1])
    corners = points[cells[:, : len(cell.edges)]]
    edges = corners[:, cell.edges] - corners[:, :, None, :]
    length = np.linalg.norm(edges, axis=-1, keepdims=True)
    values = determinants(edges / np.maximum(length, np.finfo(float).tiny)).min(axis=1)
    return np.asarray((_BEST_CORNER[cell.dim] if cell.is_simplex else 1.0) * values)


def cell_volumes(points: np.ndarray, cells: np.ndarray) -> np.ndarray:
    """Compute the volume (area) of every cell, exactly.

    Two Gauss points in each direction integrate the quadratic Jacobian of a trilinear map, three that of a
    triquadratic one, of degree five.

    Returns:
        (n_cells,) volumes.
    """
    cell = cell_type_of(cells, points.shape[1])
    if cell.is_affine:
        return np.asarray(cell.reference_volume * jacobians(points, cells)[:, 0])
    positions, weights = quadrature(cell)
    return np.asarray(jacobians(points, cells, positions) @ weights)


def volume(points: np.ndarray, cells: np.ndarray) -> float:
    """Compute the volume (area) of the whole mesh."""
    return float(cell_volumes(points, cells).sum())


def thickness(points: np.ndarray, cells: np.ndarray) -> np.ndarray:
    """Return the smallest Jacobian of every cell over the area (length) of its bounding box's diagonal.

    Returns:
        (n_cells,) [length]; 0 where a cell is inverted or flat, else a fraction of the diagonal.
    """
    corners = points[cells]
    size = np.linalg.norm(corners.max(axis=1) - corners.min(axis=1), axis=1)
    smallest = jacobians(points, cells).min(axis=1) / np.maximum(size, 1e-100) ** points.shape[1]
    return np.asarray(np.where(smallest <= FLAT, 0.0, smallest) * size)
