"""Changes of volume in the mean of each cell, against locking where plastic flow keeps the volume."""

from __future__ import annotations

import numpy as np


class MeanStrain:
    """Displacement gradients of small strain whose traces are the means of their cells: B-bar.

    H̄ = H + (⟨tr H⟩ − tr H) I / 3. Linear cells whose points must all keep their volume lock; these ask it of
    their cells alone. Forces and stiffness are the first and the second derivative of the same energy where
    there is one.

    References:
        T. J. R. Hughes, Generalization of selective integration procedures to anisotropic and nonlinear
        media, International Journal for Numerical Methods in Engineering 15 (1980).
    """

    def __init__(self, gradients: np.ndarray, weights: np.ndarray) -> None:
        """Average the divergence of each shape function.

        Args:
            gradients: Of the shape functions, shape (n_cells, n_gauss, nodes, dim), [1 / length].
            weights: Of the points, shape (n_cells, n_gauss), [length^dim].
        """
        self._gradients, self._weights = gradients, weights
        self._shares = weights / weights.sum(axis=1, keepdims=True)

    def averaged(self, tensors: np.ndarray) -> np.ndarray:
        """Return H̄ of H; of the stress on H̄ that which does the same work on H.

        Args:
            tensors: H, or the stress, shape (n_cells, n_gauss, 3, 3).
        """
        trace = np.einsum("cqii->cq", tensors)
        apart = (self._shares * trace).sum(axis=1, keepdims=True) - trace
        return np.asarray(tensors + apart[..., None, None] * np.eye(3) / 3.0)

    def blocks(self, tangent: np.ndarray) -> np.ndarray:
        """Return what ∫ ∇v̄ : A : ∇ū has beside ∫ ∇v : A : ∇u, shape (n_cells, dim nodes, dim nodes).

        Args:
            tangent: A, shape (n_cells, n_gauss, 3, 3, 3, 3), [force / length²].
        """
        G, dim = self._gradients, self._gradients.shape[-1]
        flat = (*G.shape[:2], -1)
        apart = (np.einsum("cq,cqad->cad", self._shares, G)[:, None] - G).reshape(flat) / 3.0
        by_trace = np.einsum("cqijkk->cqij", tangent)
        from_trace = np.einsum("cqiikl->cqkl", tangent)
        both = np.einsum("cqii->cq", by_trace)
        left = (G @ by_trace[..., :dim, :dim].swapaxes(2, 3)).reshape(flat)
        right = (G @ from_trace[..., :dim, :dim].swapaxes(2, 3)).reshape(flat) + both[..., None] * apart
        w = self._weights[..., None]
        outer = (w * left).swapaxes(1, 2) @ apart
        return np.asarray(outer + (w * apart).swapaxes(1, 2) @ right)
