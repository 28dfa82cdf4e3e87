"""Energy-norm errors against a known displacement field, without a form."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np

from fenics_contact import BodyMesh
from fenics_contact.mesh.cell_types import CELL_TYPES, shape_gradients, shape_values

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
    cell = CELL_TYPES[mesh.cell_type]
    values, gradients = shape_values(cell, local), shape_gradients(cell, local)
    for shapes, slopes, weight in zip(values, gradients, weights, strict=True):
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
    dim = CELL_TYPES[cell_type].dim
    place, weight = np.polynomial.legendre.leggauss(POINTS)
    points = np.stack(np.meshgrid(*dim * [(place + 1) / 2], indexing="ij"), axis=-1).reshape(-1, dim)
    grids = np.meshgrid(*dim * [weight / 2], indexing="ij")
    weights = np.stack(grids, axis=-1).reshape(-1, dim).prod(axis=1)
    if CELL_TYPES[cell_type].is_simplex:
        left = np.ones(len(points))
        for axis in range(dim):
            points[:, axis] *= left
            weights = weights * left if axis else weights
            left = left - points[:, axis]
    return points, weights
