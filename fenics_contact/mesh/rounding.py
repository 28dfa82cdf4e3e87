"""Accuracy of coordinates: their rounding grows with the distance of a body from the origin."""

from __future__ import annotations

import numpy as np

LAST_BITS = 8.0
"""A rotated and shifted coordinate is off by a few units in the last place; a difference by twice as many."""

OPERATIONS = 8.0
"""Number of roundings of coordinates that a few operations on them add up to."""

NOTHING = 1e-10
"""Lengths below this fraction of a body's size, plus the rounding of its coordinates, count as zero."""


def coordinate_rounding(points: np.ndarray) -> float:
    """Return the largest distance of nodes that are meant to coincide, [length].

    Args:
        points: Coordinates, (n_nodes, 3 | 2).
    """
    return float(LAST_BITS * np.finfo(np.float64).eps * np.abs(points).max(initial=0.0))


def computed_rounding(points: np.ndarray) -> float:
    """Return how far off a length may be that a few operations make of coordinates, [length].

    Args:
        points: Coordinates, (n_nodes, 3 | 2).
    """
    return OPERATIONS * coordinate_rounding(points)
