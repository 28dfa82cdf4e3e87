"""Rosenbrock's search along axes that turn, a method of designers that needs no derivative.

References:
    H. H. Rosenbrock, An automatic method for finding the greatest or least value of a function, Comput. J. 3
    (1960) 175-184.
"""

from __future__ import annotations

from collections.abc import Callable

import numpy as np


def rosenbrock(
    value: Callable[[np.ndarray], float],
    start: np.ndarray,
    bounds: tuple[np.ndarray, np.ndarray],
    step: float = 0.1,
    least: float = 1e-4,
) -> str:
    """Minimise within a box: one step along every axis by turns, three times as long after a success.

    A step that fails is reversed and halved. Where every axis has had a success and a failure after it, the
    axes turn: the first along the way of the stage, the others orthogonal to it. A step out of the box fails.

    Args:
        value: J of variables scaled by the widths of the box; its exception ends the search.
        start: Scaled variables, shape (n,).
        bounds: Scaled bounds; variables between equal ones stay.
        step: First step along every axis.
        least: Stops where all steps, or all ways of a stage, are shorter.

    Returns:
        Why it stopped.
    """
    lower, upper = bounds
    free = np.flatnonzero(upper > lower)
    x, axes = np.array(start), np.eye(start.size)[free]
    best = value(x)
    while True:
        steps, sums = np.full(free.size, step), np.zeros(free.size)
        gained, lost = np.zeros(free.size, bool), np.zeros(free.size, bool)
        while not (gained & lost).all():
            for k, axis in enumerate(axes):
                trial = x + steps[k] * axis
                inside = (trial >= lower).all() and (trial <= upper).all()
                if inside and (found := value(trial)) < best:
                    x, best, sums[k], steps[k] = trial, found, sums[k] + steps[k], 3.0 * steps[k]
                    gained[k] = True
                else:
                    steps[k] *= -0.5
                    lost[k] |= gained[k]
            if np.abs(steps).max() < least:
                return "converged"
        if np.abs(sums).max() < least:
            return "converged"
        axes = _turned(axes, sums)


def _turned(axes: np.ndarray, sums: np.ndarray) -> np.ndarray:
    """Return orthonormal axes, the k-th from the ways along the k-th and later axes."""
    ways = np.cumsum((sums[:, None] * axes)[::-1], axis=0)[::-1]
    turned, factor = np.linalg.qr(ways.T)
    return np.asarray((turned * np.where(np.diag(factor) < 0.0, -1.0, 1.0)).T, dtype=np.float64)
