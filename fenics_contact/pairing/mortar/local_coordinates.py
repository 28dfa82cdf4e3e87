"""Local coordinates of points on flat facets, in closed form, and the quadrature rules of simplices."""

from __future__ import annotations

import numpy as np

from fenics_contact.mesh import CELL_TYPES, FACET_TYPES, quadrature
from fenics_contact.surfaces import shape_functions


def local_coordinates(points: np.ndarray, flat: np.ndarray) -> np.ndarray:
    """Invert the (bi)linear map of flat facets.

    A bilinear map x = c + a s + b t + d s t becomes s + d₁ s t = s₀, t + d₂ s t = t₀ in the axes (a, b). The
    product p = s t solves d₁ d₂ p² − (1 + d₂ s₀ + d₁ t₀) p + s₀ t₀ = 0; of its roots the one that tends to
    s₀ t₀ for d → 0 belongs to the inside of a convex facet.

    Args:
        points: Points of each facet, shape (n, q, dim − 1).
        flat: Corners, shape (n, corners, dim − 1).

    Returns:
        Local coordinates as `shape_functions` takes them, shape (n, q, dim − 1).
    """
    corners = flat.shape[1]
    if corners == 2:
        middle, half = (flat[:, :1] + flat[:, 1:]) / 2, (flat[:, 1:] - flat[:, :1]) / 2
        return (points - middle) / half
    if corners == 3:
        return _affine(points - flat[:, :1], flat[:, 1] - flat[:, 0], flat[:, 2] - flat[:, 0])
    centre, a, b, d = (np.array(_SIGNS) / 4 @ flat).transpose(1, 0, 2)
    start = _affine(points - centre[:, None], a, b)
    twist = _affine(d[:, None], a, b)
    s, t, d1, d2 = start[:, :, 0], start[:, :, 1], twist[:, :, 0], twist[:, :, 1]
    product, sum_ = s * t, 1 + d2 * s + d1 * t
    root = np.sqrt(np.maximum(sum_**2 - 4 * d1 * d2 * product, 0))
    return start - (2 * product / (sum_ + root))[:, :, None] * twist


def local_coordinates_pulled_back(
    local: np.ndarray, flat: np.ndarray, by_local: np.ndarray
) -> tuple[np.ndarray, np.ndarray]:
    """Vector-Jacobian product of the local coordinates of points with respect to the points and the corners.

    From x = Σ N_j(ξ) x_j follows J δξ = δx − Σ N_j δx_j with J = ∂x/∂ξ.

    Args:
        local: ξ, shape (n, q, dim − 1).
        flat: Corners, shape (n, corners, dim − 1).
        by_local: Derivative by ξ, in its shape.

    Returns:
        By the points, shape (n, q, dim − 1), and by the corners, in the shape of ``flat``.
    """
    n, points, width = local.shape
    values, slopes = shape_functions(local.reshape(-1, width), flat.shape[1])
    tangents = np.einsum("nqka,nkd->nqad", slopes.reshape(n, points, -1, width), flat)
    if width == 1:
        by_points = by_local / tangents[:, :, 0]
    else:
        a, b = tangents[:, :, 0], tangents[:, :, 1]
        det = a[:, :, 0] * b[:, :, 1] - a[:, :, 1] * b[:, :, 0]
        first, second = by_local[:, :, 0] / det, by_local[:, :, 1] / det
        by_points = np.stack(
            [first * b[:, :, 1] - second * a[:, :, 1], second * a[:, :, 0] - first * b[:, :, 0]], axis=2
        )
    return by_points, -values.reshape(n, points, -1).transpose(0, 2, 1) @ by_points


#: Corners to the coefficients of 1, s, t and s t, times four.
_SIGNS = [[1.0, 1, 1, 1], [-1, 1, 1, -1], [-1, -1, 1, 1], [1, -1, 1, -1]]


def _affine(away: np.ndarray, a: np.ndarray, b: np.ndarray) -> np.ndarray:
    """Return the components of vectors (n, q, 2) in the axes a and b, each (n, 2)."""
    det = (a[:, 0] * b[:, 1] - a[:, 1] * b[:, 0])[:, None]
    x, y = away[:, :, 0], away[:, :, 1]
    s = (x * b[:, None, 1] - y * b[:, None, 0]) / det
    t = (y * a[:, None, 0] - x * a[:, None, 1]) / det
    return np.stack([s, t], axis=2)


def rule(dim: int) -> tuple[np.ndarray, np.ndarray]:
    """Return a quadrature rule of degree 5: three points of intervals (dim 2), seven of triangles (dim 3).

    Returns:
        Barycentric coordinates, shape (q, dim), and weights that add up to one, shape (q,).
    """
    positions, weights = quadrature(FACET_TYPES[3, 2] if dim == 2 else CELL_TYPES["triangle6"])
    return np.column_stack([1 - positions.sum(axis=1), positions]), weights / weights.sum()
