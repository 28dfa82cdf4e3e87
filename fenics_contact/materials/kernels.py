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


def motions_of_revolution(points: np.ndarray, torsion: bool, radius: float | None = None) -> np.ndarray:
    """Return the translation along the axis of bodies of revolution and, with torsion, the turn about it.

    The turn is u_θ = r / R, of about the same size as the translation.

    Args:
        points: Coordinates r and z, shape (n, 2), [length].
        torsion: Whether displacements have the component u_θ.
        radius: R, [length]; by default the largest of the points.

    Returns:
        Modes, dimensionless: shape (n, 2, 1), with torsion (n, 3, 2).
    """
    modes = np.zeros((len(points), 3, 2) if torsion else (len(points), 2, 1))
    modes[:, 1, 0] = 1.0
    if torsion:
        size = float(points[:, 0].max(initial=0.0)) if radius is None else radius
        modes[:, 2, 1] = points[:, 0] / max(size, np.finfo(float).tiny)
    return modes
