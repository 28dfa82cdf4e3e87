"""Detection of similarities: motions that only scale, rotate and shift."""

from __future__ import annotations

import numpy as np

from fenics_contact.mesh.rounding import computed_rounding


def similarity(points: np.ndarray, moved: np.ndarray) -> tuple[np.ndarray, np.ndarray, float] | None:
    """Return rotation, translation and scale that move points, x -> scale · rotation x + translation.

    Args:
        points: Old positions, (n, dim).
        moved: New positions, (n, dim).

    Returns:
        (dim, dim), (dim,) and a positive number; None if the motion is not a similarity.

    References:
        Umeyama, S.: Least-squares estimation of transformation parameters between two point patterns. IEEE
        Transactions on Pattern Analysis and Machine Intelligence 13 (1991).
    """
    centre, there = points.mean(axis=0), moved.mean(axis=0)
    away, arrived = points - centre, moved - there
    left, stretch, right = np.linalg.svd(arrived.T @ away)
    sign = np.ones(len(stretch))
    sign[-1] = np.sign(np.linalg.det(left) * np.linalg.det(right))
    scale = float((stretch * sign).sum() / (away**2).sum())
    rotation = (left * sign) @ right
    # Pure shifts, and half turns and the like, are exact.
    scale = 1.0 if abs(scale - 1.0) < 1e-14 else scale
    rotation = np.where(np.abs(rotation - np.round(rotation)) < 1e-14, np.round(rotation), rotation)
    shift = there - scale * rotation @ centre
    off = np.abs(scale * points @ rotation.T + shift - moved).max()
    if not (scale > 0 and off <= computed_rounding(moved) + scale * computed_rounding(points)):
        return None
    return rotation, shift, scale
