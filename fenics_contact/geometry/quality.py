"""Jacobians, volumes and shape quality of hexahedra (trilinear) and tetrahedra, for all cells at once."""

from __future__ import annotations

import numpy as np

HEXAHEDRON_VERTICES = np.array(
    [[0, 0, 0], [1, 0, 0], [1, 1, 0], [0, 1, 0], [0, 0, 1], [1, 0, 1], [1, 1, 1], [0, 1, 1]], dtype=np.float64
)
"""Reference coordinates of the vertices of a hexahedron, VTK order."""

HEXAHEDRON_LATTICE = np.stack(np.meshgrid(*3 * [[0.0, 0.5, 1.0]], indexing="ij"), axis=-1).reshape(-1, 3)
"""Vertices, edge and face midpoints and centre: where the Jacobian of a hexahedron is looked at.

The determinant is quadratic in each coordinate, so these 27 values fix it everywhere."""

HEXAHEDRON_EDGES = np.array(
    [[1, 3, 4], [2, 0, 5], [3, 1, 6], [0, 2, 7], [7, 5, 0], [4, 6, 1], [5, 7, 2], [6, 4, 3]], dtype=np.int64
)
"""Other ends of the three edges at every vertex, right-handed."""

TETRAHEDRON_EDGES = np.array([[1, 2, 3], [2, 0, 3], [0, 1, 3], [0, 2, 1]], dtype=np.int64)
"""Other ends of the three edges at every vertex, right-handed."""

_GAUSS = (HEXAHEDRON_VERTICES - 0.5) / np.sqrt(3.0) + 0.5


def determinants(matrices: np.ndarray) -> np.ndarray:
    """Compute 3 x 3 determinants of a stack, (..., 3, 3) to (...)."""
    a, b, c = matrices[..., 0, :], matrices[..., 1, :], matrices[..., 2, :]
    return np.asarray(
        a[..., 0] * (b[..., 1] * c[..., 2] - b[..., 2] * c[..., 1])
        + a[..., 1] * (b[..., 2] * c[..., 0] - b[..., 0] * c[..., 2])
        + a[..., 2] * (b[..., 0] * c[..., 1] - b[..., 1] * c[..., 0])
    )


def _shape_gradients(position: np.ndarray) -> np.ndarray:
    """Gradients of the eight trilinear shape functions at one reference position, (8, 3)."""
    sign = 2.0 * HEXAHEDRON_VERTICES - 1.0
    factor = np.where(HEXAHEDRON_VERTICES == 1.0, position, 1.0 - position)
    return np.asarray(sign * np.roll(factor, 1, axis=1) * np.roll(factor, 2, axis=1))


def jacobians(points: np.ndarray, cells: np.ndarray, positions: np.ndarray | None = None) -> np.ndarray:
    """Evaluate the Jacobian determinant of the map from the reference cell.

    Args:
        points: Coordinates, (n_nodes, 3).
        cells: Node numbers, (n_cells, 8 | 4).
        positions: Reference coordinates, (m, 3), for hexahedra; the 27 points of `HEXAHEDRON_LATTICE`
            unless given. A tetrahedron has one constant Jacobian, six times its volume.

    Returns:
        (n_cells, m) for hexahedra, (n_cells, 1) for tetrahedra, in cubed units of length.
    """
    corners = points[cells]
    if cells.shape[1] == 4:
        return determinants(corners[:, 1:] - corners[:, :1])[:, None]
    if positions is None:
        positions = HEXAHEDRON_LATTICE
    columns = np.ascontiguousarray(corners.transpose(0, 2, 1)).reshape(-1, 8)
    values = np.empty((cells.shape[0], positions.shape[0]))
    for m, position in enumerate(positions):  # a few positions, all cells at once: keeps the arrays small
        values[:, m] = determinants((columns @ _shape_gradients(position)).reshape(-1, 3, 3))
    return values


def jacobian_ratio(points: np.ndarray, cells: np.ndarray) -> np.ndarray:
    """Compare the smallest with the largest Jacobian inside every cell.

    Returns:
        (n_cells,) values in [-1, 1]: 1 for a parallelepiped or a proper tetrahedron, 0 or less where the
        cell is degenerate or inverted.
    """
    values = jacobians(points, cells)
    largest = np.maximum(np.abs(values).max(axis=1), np.finfo(float).tiny)
    return np.asarray(values.min(axis=1) / largest)


def scaled_jacobian(points: np.ndarray, cells: np.ndarray) -> np.ndarray:
    """Compute the smallest corner determinant of the unit edge vectors of every cell.

    For tetrahedra it is multiplied by the square root of 2.

    Returns:
        (n_cells,) values in [-1, 1]: 1 for a box or a regular tetrahedron, 0 or less where inverted.
    """
    table = HEXAHEDRON_EDGES if cells.shape[1] == 8 else TETRAHEDRON_EDGES
    corners = points[cells]
    edges = corners[:, table] - corners[:, :, None, :]
    length = np.linalg.norm(edges, axis=-1, keepdims=True)
    values = determinants(edges / np.maximum(length, np.finfo(float).tiny)).min(axis=1)
    return np.asarray(values if cells.shape[1] == 8 else np.sqrt(2.0) * values)


def cell_volumes(points: np.ndarray, cells: np.ndarray) -> np.ndarray:
    """Compute the volume of every cell, exactly.

    Two Gauss points in each direction integrate the quadratic Jacobian of a trilinear map.

    Returns:
        (n_cells,) volumes.
    """
    if cells.shape[1] == 4:
        return np.asarray(jacobians(points, cells)[:, 0] / 6.0)
    return np.asarray(jacobians(points, cells, _GAUSS).mean(axis=1))


def volume(points: np.ndarray, cells: np.ndarray) -> float:
    """Compute the volume of the whole mesh."""
    return float(cell_volumes(points, cells).sum())


def is_inverted(points: np.ndarray, cells: np.ndarray) -> np.ndarray:
    """Find the cells whose Jacobian is not clearly positive.

    "Clearly" leaves room for rounding only: 1e-14 of the cube of the cell's bounding-box diagonal.

    Returns:
        (n_cells,) bool.
    """
    corners = points[cells]
    size = np.linalg.norm(corners.max(axis=1) - corners.min(axis=1), axis=1)
    return np.asarray(jacobians(points, cells).min(axis=1) <= 1e-14 * size**3)
