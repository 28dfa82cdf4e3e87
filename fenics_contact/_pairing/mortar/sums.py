"""Sums of arrays over groups of entries."""

from __future__ import annotations

import math

import numpy as np
from scipy import sparse


class SumsBy:
    """Sums of arrays over the entries with the same number.

    Args:
        number: Group of each entry, shape (n,).
        groups: Number of groups; by default up to the largest that occurs.
    """

    def __init__(self, number: np.ndarray, groups: int | None = None) -> None:
        self.groups, count = groups or int(number.max(initial=-1)) + 1, len(number)
        # By columns, of which each has one entry: there is nothing to sort.
        entries = np.ones(count), number, np.arange(count + 1)
        self._matrix = sparse.csc_matrix(entries, shape=(self.groups, count))

    def __call__(self, values: np.ndarray) -> np.ndarray:
        """Return the sums of values, shape (n, ...), shape (groups, ...)."""
        shape = values.shape[1:]
        summed = self._matrix @ values.reshape(len(values), math.prod(shape))
        return np.asarray(summed.reshape(len(summed), *shape), dtype=np.float64)
