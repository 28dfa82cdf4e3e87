"""How far coordinates can be trusted: they are rounded the more, the farther a body lies from the origin."""

from __future__ import annotations

import numpy as np

LAST_BITS = 8.0
"""A coordinate that was turned and shifted is off by a few units in its last place; two of them by twice."""


def coordinate_rounding(points: np.ndarray) -> float:
    """Return how far apart nodes may be that are meant to be at the same place, [length].

    Args:
        points: Coordinates, (n_nodes, 3 | 2).
    """
    return float(LAST_BITS * np.finfo(np.float64).eps * np.abs(points).max(initial=0.0))
