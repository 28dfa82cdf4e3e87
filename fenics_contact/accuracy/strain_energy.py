"""Energy of the difference between recovered displacement gradients and those of the displacement."""

from __future__ import annotations

import numpy as np

from fenics_contact.mesh import CELL_TYPES, CellType, determinants, quadrature, shape_gradients, shape_values


def energy_of_difference(
    moduli: np.ndarray, cell_type: str, points: np.ndarray, displacement: np.ndarray, gradient: np.ndarray
) -> np.ndarray:
    """Return ∫ C (g − ∇u) : (g − ∇u) over each of some cells of one material.

    Args:
        moduli: C from `moduli`, shape (dim², dim²), [force / length²].
        cell_type: Type of the cells.
        points: Coordinates of the nodes, shape (n, nodes of a cell, dim), [length].
        displacement: u at the nodes, shape (n, nodes of a cell, dim), [length].
        gradient: g at the nodes, (k, j) for ∂u_k/∂x_j, shape (n, nodes of a cell, dim, dim).

    Returns:
        Shape (n,), [force · length].
    """
    cell = CELL_TYPES[cell_type]
    integrate = _over_simplices if cell.is_affine else _by_quadrature
    return integrate(moduli, cell, points, displacement, gradient)


def _over_simplices(
    moduli: np.ndarray, cell: CellType, points: np.ndarray, displacement: np.ndarray, gradient: np.ndarray
) -> np.ndarray:
    """The difference d is linear: ∫ C d : d = |K| (Σ C d_v : d_v + C Σd_v : Σd_v) / (m (m + 1))."""
    n, m, _ = points.shape
    (slopes,) = shape_gradients(cell, cell.vertices[:1])
    of_cells, jacobian = _cell_gradients(points, displacement, slopes)
    difference = (gradient - of_cells[:, None]).reshape(n, m, -1)
    difference = np.concatenate([difference, difference.sum(axis=1, keepdims=True)], axis=1)
    density = np.einsum("nva,nva->n", difference @ moduli, difference)
    return np.asarray(cell.reference_volume * jacobian * density / (m * (m + 1)))


def _by_quadrature(
    moduli: np.ndarray, cell: CellType, points: np.ndarray, displacement: np.ndarray, gradient: np.ndarray
) -> np.ndarray:
    """Exact where the map from the reference cell is affine."""
    positions, weights = quadrature(cell)
    values, slopes = shape_values(cell, positions), shape_gradients(cell, positions)
    total = np.zeros(len(points))
    for weight, value, slope in zip(weights, values, slopes, strict=True):  # a few points, all cells at once
        of_cells, jacobian = _cell_gradients(points, displacement, slope)
        difference = (np.tensordot(gradient, value, axes=(1, 0)) - of_cells).reshape(len(points), -1)
        total += weight * jacobian * np.einsum("na,na->n", difference @ moduli, difference)
    return total


def _cell_gradients(
    points: np.ndarray, displacement: np.ndarray, slopes: np.ndarray
) -> tuple[np.ndarray, np.ndarray]:
    """Return ∇u and the Jacobian determinant of cells at one point, shapes (n, dim, dim) and (n,).

    Args:
        points: Coordinates of the nodes, shape (n, nodes of a cell, dim).
        displacement: u there, shape (n, nodes of a cell, dim).
        slopes: Gradients of the shape functions at the point, shape (nodes of a cell, dim).
    """
    jacobian = np.matmul(points.transpose(0, 2, 1), slopes)
    determinant, adjugate = determinants(jacobian), _adjugate(jacobian)
    along = np.matmul(displacement.transpose(0, 2, 1), slopes)
    return np.matmul(along, adjugate) / determinant[:, None, None], determinant


def _adjugate(matrices: np.ndarray) -> np.ndarray:
    """Return inverse times determinant of small matrices, shape (n, dim, dim)."""
    if matrices.shape[1] == 2:
        (a, b), (c, d) = matrices.transpose(1, 2, 0)
        return np.stack([np.stack([d, -b], axis=1), np.stack([-c, a], axis=1)], axis=1)
    a, b, c = matrices.transpose(1, 0, 2)
    return np.stack([_cross(b, c), _cross(c, a), _cross(a, b)], axis=2)


def _cross(a: np.ndarray, b: np.ndarray) -> np.ndarray:
    """Cross products of rows; NumPy's own is dominated by its overhead."""
    ahead, behind = [1, 2, 0], [2, 0, 1]
    return np.asarray(a[:, ahead] * b[:, behind] - a[:, behind] * b[:, ahead])
