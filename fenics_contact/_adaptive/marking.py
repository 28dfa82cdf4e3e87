"""Which cells are refined."""

from __future__ import annotations

from collections.abc import Mapping

import numpy as np


def bulk(shares: Mapping[str, np.ndarray], fraction: float, most: float = 1.0) -> dict[str, np.ndarray]:
    """Return the fewest cells of all bodies that hold a fraction of the sum of their shares of an error.

    Cells with equal shares are all taken or none, so that the numbering of cells and rounding decide nothing.
    Source: W. Dörfler, A convergent adaptive algorithm for Poisson's equation, SIAM J. Numer. Anal. 33 (1996)
    1106-1124. `most`: largest part of the cells to mark, between 0 and 1, up to ties.
    """
    every = np.sort(np.concatenate(list(shares.values())))[::-1]
    held = np.cumsum(every)
    last = min(int(np.searchsorted(held, fraction * held[-1])), max(int(most * len(every)), 1) - 1)
    # Shares that differ by rounding are equal.
    threshold = every[last] * (1.0 - 1e-9)
    marked = {name: np.flatnonzero((share >= threshold) & (share > 0.0)) for name, share in shares.items()}
    return {name: cells for name, cells in marked.items() if len(cells)}
