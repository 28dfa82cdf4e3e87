"""Changes of volume in the mean of each cell, against locking where plastic flow keeps the volume."""

from __future__ import annotations

import numpy as np

from fenics_contact.fem.cell_polynomials import CellPolynomials

#: Bulk modulus at rest of what is not projected, by the shear modulus, in cells of type `UNSEEN`.
HELD = 0.02


def held_share(moduli: np.ndarray) -> float:
    """Return the share of a dilatation's variation in a cell that is not projected away, see `HELD`.

    Args:
        moduli: Of the material at rest, by Voigt components, shape (6, 6), [force / length²].
    """
    bulk, shear = moduli[:3, :3].sum() / 9.0, np.trace(moduli[3:, 3:]) / 3.0
    return float(np.sqrt(min(1.0, HELD * shear / bulk)))


class MeanStrain:
    """Displacement gradients of small strain whose traces are the projections of their cells: B-bar.

    H̄ = H + (1 − s) (Π tr H − tr H) I / 3 with the projection Π on the polynomials of each cell, its mean or
    linear ones. Linear cells whose points must all keep their volume lock; these ask it of their cells alone.
    Forces and stiffness are the first and the second derivative of the same energy where there is one. The
    share s is zero unless deformations would be without energy then.

    References:
        T. J. R. Hughes, Generalization of selective integration procedures to anisotropic and nonlinear
        media, International Journal for Numerical Methods in Engineering 15 (1980).
    """

    def __init__(self, gradients: np.ndarray, polynomials: CellPolynomials, share: float = 0.0) -> None:
        """Project the divergence of each shape function.

        Args:
            gradients: Of the shape functions, shape (n_cells, n_gauss, nodes, dim), [1 / length].
            polynomials: Of the same cells.
            share: The share s.
        """
        self._gradients, self._polynomials, self._part = gradients, polynomials, 1.0 - share

    def averaged(self, tensors: np.ndarray) -> np.ndarray:
        """Return H̄ of H; of the stress on H̄ that which does the same work on H.

        Args:
            tensors: H, or the stress, shape (n_cells, n_gauss, 3, 3).
        """
        apart = self._apart(np.einsum("cqii->cq", tensors)[..., None])
        return np.asarray(tensors + apart[..., None] * np.eye(3))

    def _apart(self, traces: np.ndarray) -> np.ndarray:
        """Return what a third of traces lacks of their projections, shape (n_cells, n_gauss, k)."""
        return self._part / 3.0 * (self._polynomials.projected(traces) - traces)

    def blocks(self, tangent: np.ndarray) -> np.ndarray:
        """Return what ∫ ∇v̄ : A : ∇ū has beside ∫ ∇v : A : ∇u, shape (n_cells, dim nodes, dim nodes).

        Args:
            tangent: A, shape (n_cells, n_gauss, 3, 3, 3, 3), [force / length²].
        """
        G, dim = self._gradients, self._gradients.shape[-1]
        flat = (*G.shape[:2], -1)
        apart = self._apart(G.reshape(flat))
        by_trace = np.einsum("cqijkk->cqij", tangent)
        from_trace = np.einsum("cqiikl->cqkl", tangent)
        both = np.einsum("cqii->cq", by_trace)
        left = (G @ by_trace[..., :dim, :dim].swapaxes(2, 3)).reshape(flat)
        right = (G @ from_trace[..., :dim, :dim].swapaxes(2, 3)).reshape(flat) + both[..., None] * apart
        w = self._polynomials.weights[..., None]
        outer = (w * left).swapaxes(1, 2) @ apart
        return np.asarray(outer + (w * apart).swapaxes(1, 2) @ right)
