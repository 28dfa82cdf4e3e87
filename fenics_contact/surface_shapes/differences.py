"""Central differences with a step adapted to the position of the points."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np

#: Step of a central difference, relative to the extent of the points: the smallest one. Far from the origin
#: it balances the rounding of the values and the truncation error.
DIFFERENCE = 1e-5


def differences(function: Callable[[np.ndarray], np.ndarray], points: np.ndarray) -> np.ndarray:
    """Return central differences along each axis, stacked last.

    Args:
        function: Vectorised, (n, dim) -> (n, ...).
        points: Points, shape (n, dim).
    """
    if len(points) == 0:
        return np.zeros((*np.shape(function(points)), points.shape[1]))
    far = float(np.abs(points).max()) or 1.0
    extent = float(np.ptp(points, axis=0).max()) or far
    step = max(DIFFERENCE * extent, float(np.cbrt(np.finfo(float).eps * far * extent**2)))
    shifts = step * np.eye(points.shape[1])
    slopes = [(function(points + shift) - function(points - shift)) / (2 * step) for shift in shifts]
    return np.stack(slopes, axis=-1)
