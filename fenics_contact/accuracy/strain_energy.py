"""Energy of the difference between recovered displacement gradients and those of the displacement."""

from __future__ import annotations

import numpy as np

from fenics_contact.geometry.cell_types import CELL_TYPES
from fenics_contact.geometry.quality import determinants


def energy_of_difference(
    moduli: np.ndarray, cell_type: str, points: np.ndarray, displacement: np.ndarray, gradient: np.ndarray
) -> np.ndarray:
    """Return ∫ C (g − ∇u) : (g − ∇u) over each of some cells of one material.

    Args:
        moduli: C as `moduli` gives it, shape (dim², dim²), [force / length²].
        cell_type: Type of the cells.
        points: Coordinates of the vertices, shape (n, n_vertices, dim), [length].
        displacement: u at the vertices, shape (n, n_vertices, dim), [length].
        gradient: g at the vertices, (k, j) for ∂u_k/∂x_j, shape (n, n_vertices, dim, dim).

    Returns:
        Shape (n,), [force · length].
    """
    on_simplices = CELL_TYPES[cell_type].is_simplex
    integrate = _over_simplices if on_simplices else _over_tensor_cells
    return integrate(moduli, cell_type, points, displacement, gradient)


def _over_simplices(
    moduli: np.ndarray, cell_type: str, points: np.ndarray, displacement: np.ndarray, gradient: np.ndarray
) -> np.ndarray:
    """The difference d is linear: ∫ C d : d = |K| (Σ C d_v : d_v + C Σd_v : Σd_v) / (m (m + 1))."""
    n, m, dim = points.shape
    slopes = np.vstack([-np.ones(dim), np.eye(dim)])
    of_cells, jacobian = _cell_gradients(points, displacement, slopes)
    difference = (gradient - of_cells[:, None]).reshape(n, m, -1)
    difference = np.concatenate([difference, difference.sum(axis=1, keepdims=True)], axis=1)
    density = np.einsum("nva,nva->n", difference @ moduli, difference)
    return np.asarray(CELL_TYPES[cell_type].reference_volume * jacobian * density / (m * (m + 1)))


def _over_tensor_cells(
    moduli: np.ndarray, cell_type: str, points: np.ndarray, displacement: np.ndarray, gradient: np.ndarray
) -> np.ndarray:
    """Two Gauss points in a direction: exact for a difference of first degree in each coordinate."""
    vertices, n = CELL_TYPES[cell_type].vertices, len(points)
    total = np.zeros(n)
    for place in 0.5 + (vertices - 0.5) / np.sqrt(3.0):  # a few places, all cells at once
        factors = np.where(vertices == 1.0, place, 1 - place)
        others = [np.delete(factors, axis, axis=1).prod(axis=1) for axis in range(len(place))]
        slopes = (2 * vertices - 1) * np.column_stack(others)
        of_cells, jacobian = _cell_gradients(points, displacement, slopes)
        here = np.tensordot(gradient, factors.prod(axis=1), axes=(1, 0))
        difference = (here - of_cells).reshape(n, -1)
        total += jacobian * np.einsum("na,na->n", difference @ moduli, difference)
    return total / len(vertices)


def _cell_gradients(
    points: np.ndarray, displacement: np.ndarray, slopes: np.ndarray
) -> tuple[np.ndarray, np.ndarray]:
    """Return ∇u and the Jacobian determinant of cells at one place, shapes (n, dim, dim) and (n,).

    Args:
        points: Coordinates of the vertices, shape (n, n_vertices, dim).
        displacement: u there, shape (n, n_vertices, dim).
        slopes: Of the shape functions at the place, shape (n_vertices, dim).
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
    """Cross products of rows; NumPy's own takes longer to look at its axes than to multiply."""
    ahead, behind = [1, 2, 0], [2, 0, 1]
    return np.asarray(a[:, ahead] * b[:, behind] - a[:, behind] * b[:, ahead])
