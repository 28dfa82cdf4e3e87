"""Tensor-product Bernstein polynomials on the unit interval and square."""

from __future__ import annotations

import numpy as np
from scipy.special import comb


def bernstein(parameters: np.ndarray, count: int) -> np.ndarray:
    """Evaluate the ``count`` Bernstein polynomials of degree count − 1, B_k(t) = C(n,k) t^k (1 − t)^(n − k).

    Args:
        parameters: t in [0, 1], shape (m,).

    Returns:
        Values, shape (m, count); each row is a partition of unity.
    """
    k = np.arange(count)
    t = parameters[:, None]
    return comb(count - 1, k) * t**k * (1 - t) ** (count - 1 - k)


def tensor_bernstein(parameters: np.ndarray, counts: tuple[int, ...]) -> np.ndarray:
    """Evaluate products B_k(s) B_l(t), on a curve B_k(s).

    Args:
        parameters: (s, t) in the unit square, shape (m, 2), or s in the unit interval, (m, 1).

    Returns:
        Values, shape (m, product of the counts); l runs fastest.
    """
    values = np.ones((len(parameters), 1))
    for along, count in zip(parameters.T, counts, strict=True):
        values = (values[:, :, None] * bernstein(along, count)[:, None]).reshape(len(parameters), -1)
    return values
