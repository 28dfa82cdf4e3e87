"""Grids of points in as many directions as there are rows of ticks."""

from __future__ import annotations

from collections.abc import Iterable

import numpy as np
from numpy.typing import ArrayLike


def tensor_grid(ticks: Iterable[ArrayLike]) -> np.ndarray:
    """Return all points of which each coordinate is one of its ticks, the last coordinate running fastest.

    Args:
        ticks: The ticks of each coordinate, k rows of shape (n_i,).

    Returns:
        The points, shape (n_1 ··· n_k, k).
    """
    axes = np.meshgrid(*map(np.asarray, ticks), indexing="ij")
    return np.stack(axes, axis=-1).reshape(-1, len(axes))
