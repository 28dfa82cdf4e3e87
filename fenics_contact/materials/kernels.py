"""Rigid body motions: the displacements that strain no elastic body."""

from __future__ import annotations

import numpy as np


def rigid_body_modes(points: np.ndarray, at: np.ndarray | None = None) -> np.ndarray:
    """Return the translations and the rotations about the centroid of ``points``, there or at other points.

    Rotations are divided by the largest distance from the centroid, so that all modes have about the same
    size whatever the unit of length.

    Args:
        points: Coordinates of the nodes of a body, shape (m, dim), [length].
        at: Where the modes are wanted, shape (n, dim), [length]; None for all of its nodes.

    Returns:
        Modes, dimensionless: shape (n, 3, 6) in space, (n, 2, 3) in the plane.
    """
    centre = points.mean(axis=0)
    size = max(float(np.abs(points - centre).max()), np.finfo(float).tiny)
    return motions_about(((points if at is None else at) - centre) / size, np.zeros(points.shape[1]))


def motions_about(points: np.ndarray, centre: np.ndarray) -> np.ndarray:
    """Return the unit translations and the unit rotations about a point, (dim,); shapes as above."""
    arm = points - centre
    n, dim = arm.shape
    modes = np.zeros((n, dim, 3 * (dim - 1)))
    modes[:, range(dim), range(dim)] = 1.0
    if dim == 2:
        modes[:, :, 2] = np.stack([-arm[:, 1], arm[:, 0]], axis=1)
        return modes
    for axis in range(3):
        modes[:, :, 3 + axis] = np.cross(np.eye(3)[axis], arm)
    return modes
