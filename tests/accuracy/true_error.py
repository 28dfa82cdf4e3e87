"""Energy-norm errors against a known displacement field, by NumPy alone."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np

from fenics_contact.geometry import BodyMesh
from fenics_contact.geometry.cell_types import CELL_TYPES

#: Displacement gradient at points: shape (n, dim) -> (n, dim, dim), entry (k, j) is ∂u_k/∂x_j; or a number.
Gradient = Callable[[np.ndarray], np.ndarray | float]
#: Gauss points in a direction.
POINTS = 4


def error_by_cell(
    mesh: BodyMesh, displacement: np.ndarray, exact: Gradient, lame: float, shear: float
) -> np.ndarray:
    """Return √∫ λ (tr e)² + 2G e : e over each cell with e the error of the strain, shape (n_cells,).

    Args:
        mesh: The mesh.
        displacement: Of its nodes, (n_nodes, dim).
        exact: Gradient of the solution.
        lame: λ of space or plane strain.
        shear: G.
    """
    local, weights = rule(mesh.cell_type)
    total = np.zeros(mesh.n_cells)
    x, u = mesh.points[mesh.cells], displacement[mesh.cells]
    for place, weight in zip(local, weights, strict=True):
        shapes, slopes = shape_functions(mesh.cell_type, place)
        jacobian = np.einsum("cvi,vj->cij", x, slopes)
        gradient = np.einsum("cvk,vj->ckj", u, slopes) @ np.linalg.inv(jacobian)
        wrong = exact(np.einsum("v,cvi->ci", shapes, x)) - gradient
        strain = 0.5 * (wrong + wrong.transpose(0, 2, 1))
        trace = np.einsum("cii->c", strain)
        energy = lame * trace**2 + 2 * shear * np.einsum("cij,cij->c", strain, strain)
        total += weight * np.linalg.det(jacobian) * energy
    return np.sqrt(total)


def rule(cell_type: str) -> tuple[np.ndarray, np.ndarray]:
    """Return Gauss points in the unit cube or, collapsed, in the unit simplex, and their weights."""
    dim = 2 if cell_type in ("triangle", "quadrilateral") else 3
    place, weight = np.polynomial.legendre.leggauss(POINTS)
    points = np.stack(np.meshgrid(*dim * [(place + 1) / 2], indexing="ij"), axis=-1).reshape(-1, dim)
    grids = np.meshgrid(*dim * [weight / 2], indexing="ij")
    weights = np.stack(grids, axis=-1).reshape(-1, dim).prod(axis=1)
    if cell_type in ("triangle", "tetrahedron"):
        left = np.ones(len(points))
        for axis in range(dim):
            points[:, axis] *= left
            weights = weights * left if axis else weights
            left = left - points[:, axis]
    return points, weights


def shape_functions(cell_type: str, place: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Return values, (n_vertices,), and slopes, (n_vertices, dim), at one place; vertices in VTK order."""
    vertices, dim = CELL_TYPES[cell_type].vertices, len(place)
    if len(vertices) == dim + 1:
        return np.concatenate([[1 - place.sum()], place]), np.vstack([-np.ones(dim), np.eye(dim)])
    factors = np.where(vertices == 1.0, place, 1 - place)
    slopes = [np.delete(factors, k, axis=1).prod(axis=1) * (2 * vertices[:, k] - 1) for k in range(dim)]
    return factors.prod(axis=1), np.stack(slopes, axis=1)
