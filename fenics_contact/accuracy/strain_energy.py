"""Energy of the difference between recovered displacement gradients and those of the displacement."""

from __future__ import annotations

import numpy as np

from fenics_contact.geometry.cell_types import CELL_TYPES

#: Quadrature that is exact for products of two gradients, both linear or of first degree in each coordinate:
#: two Gauss points in a direction, on simplices one point near each vertex with these coordinates.
_GAUSS = 0.5 / np.sqrt(3.0)
_NEAR = {"triangle": (2 / 3, 1 / 6), "tetrahedron": (0.58541019662496845, 0.13819660112501052)}


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
    total = np.zeros(len(points))
    places, weight = _rule(cell_type)
    for place in places:  # a few places, all cells at once
        values, slopes = _shape_functions(cell_type, place)
        jacobian = np.matmul(points.transpose(0, 2, 1), slopes)
        cells = np.matmul(np.matmul(displacement.transpose(0, 2, 1), slopes), np.linalg.inv(jacobian))
        difference = (np.einsum("v,nvkj->nkj", values, gradient) - cells).reshape(len(points), -1)
        density = np.einsum("na,na->n", difference @ moduli, difference)
        total += weight * np.linalg.det(jacobian) * density
    return total


def _rule(cell_type: str) -> tuple[np.ndarray, float]:
    """Return places in the reference cell, (m, dim), and the weight that all of them have."""
    cell = CELL_TYPES[cell_type]
    if cell.is_simplex:
        near, far = _NEAR[cell_type]
        places = far + (near - far) * cell.vertices
    else:
        places = 0.5 + 2 * _GAUSS * (cell.vertices - 0.5)
    return places, cell.reference_volume / len(places)


def _shape_functions(cell_type: str, place: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Return values, shape (n_vertices,), and slopes, shape (n_vertices, dim), at a place."""
    cell = CELL_TYPES[cell_type]
    if cell.is_simplex:
        return np.concatenate([[1 - place.sum()], place]), np.vstack([-np.ones(cell.dim), np.eye(cell.dim)])
    factors = np.where(cell.vertices == 1.0, place, 1 - place)
    others = [np.delete(factors, axis, axis=1).prod(axis=1) for axis in range(cell.dim)]
    return factors.prod(axis=1), (2 * cell.vertices - 1) * np.column_stack(others)
