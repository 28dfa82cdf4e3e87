"""Displacement gradients at Gauss points."""

from __future__ import annotations

import numpy as np


class Gradients:
    """Displacement gradients at the Gauss points of cells, and what is dual to them.

    Attributes:
        slopes: Gradients of the shape functions, shape (n_cells, n_gauss, nodes, dim), [1 / length].
    """

    def __init__(self, slopes: np.ndarray) -> None:
        """Keep the gradients of the shape functions."""
        self.slopes = slopes

    def part(self, cells: np.ndarray) -> Gradients:
        """Return those of some cells."""
        return Gradients(self.slopes[cells])

    @property
    def divergence(self) -> np.ndarray:
        """Trace of the gradient for each unit nodal displacement, shape (n_cells, n_gauss, nodes, dim)."""
        return self.slopes

    def of(self, nodal: np.ndarray) -> np.ndarray:
        """Return ∂u_i/∂X_j in three dimensions, zero out of the plane, shape (n_cells, n_gauss, 3, 3).

        `nodal`: displacements, shape (n_cells, nodes, dim), [length].
        """
        dim = self.slopes.shape[-1]
        gradient = np.zeros((*self.slopes.shape[:2], 3, 3))
        gradient[..., :dim, :dim] = nodal.swapaxes(1, 2)[:, None] @ self.slopes
        return gradient

    def contracted(self, tensors: np.ndarray) -> np.ndarray:
        """Return T : ∇v for each unit nodal v, shape (n_cells, n_gauss, nodes, dim).

        `tensors`: T, shape (n_cells, n_gauss, 3, 3).
        """
        dim = self.slopes.shape[-1]
        return np.asarray(self.slopes @ tensors[..., :dim, :dim].swapaxes(2, 3))

    def force(self, weights: np.ndarray, stress: np.ndarray) -> np.ndarray:
        """Return ∫ P : ∇v, shape (n_cells, nodes, dim), [force].

        `weights`: of the points, shape (n_cells, n_gauss); `stress`: P, shape (n_cells, n_gauss, 3, 3).
        """
        dim = self.slopes.shape[-1]
        weighted = weights[..., None, None] * stress[..., :dim, :dim]
        return np.asarray((self.slopes @ weighted.swapaxes(2, 3)).sum(axis=1))

    def blocks(self, weights: np.ndarray, tangent: np.ndarray) -> np.ndarray:
        """Return ∫ ∇v : A : ∇u, shape (n_cells, nodes, dim, nodes, dim).

        `weights`: of the points, shape (n_cells, n_gauss); `tangent`: A, shape (n_cells, n_gauss, 3, 3, 3,
        3), [force / length²].
        """
        G = self.slopes
        n, m, _, dim = G.shape
        A = weights[..., None, None, None, None] * tangent[..., :dim, :dim, :dim, :dim]
        half = A.reshape(n, m, dim**3, dim) @ G.swapaxes(2, 3)
        half = half.reshape(n, m, dim, dim, -1).swapaxes(2, 3).reshape(n, m * dim, -1)
        left = G.swapaxes(1, 2).reshape(n, -1, m * dim)
        return (left @ half).reshape(n, left.shape[1], dim, dim, left.shape[1]).swapaxes(3, 4)
