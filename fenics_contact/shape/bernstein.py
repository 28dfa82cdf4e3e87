"""Tensor-product Bernstein polynomials on the unit square."""

from __future__ import annotations

import numpy as np
from scipy.special import comb


def bernstein(parameters: np.ndarray, count: int) -> np.ndarray:
    """Evaluate the ``count`` Bernstein polynomials of degree count − 1, B_k(t) = C(n,k) t^k (1 − t)^(n − k).

    Args:
        parameters: t in [0, 1], shape (m,).
        count: Number of polynomials, at least 1.

    Returns:
        Values, shape (m, count); each row is a partition of unity.
    """
    k = np.arange(count)
    t = parameters[:, None]
    return comb(count - 1, k) * t**k * (1 - t) ** (count - 1 - k)


def tensor_bernstein(parameters: np.ndarray, counts: tuple[int, int]) -> np.ndarray:
    """Evaluate products B_k(s) B_l(t).

    Args:
        parameters: (s, t) in the unit square, shape (m, 2).
        counts: Number of polynomials along s and t.

    Returns:
        Values, shape (m, counts[0] · counts[1]); l runs fastest.
    """
    along_s, along_t = bernstein(parameters[:, 0], counts[0]), bernstein(parameters[:, 1], counts[1])
    return (along_s[:, :, None] * along_t[:, None, :]).reshape(len(parameters), -1)
