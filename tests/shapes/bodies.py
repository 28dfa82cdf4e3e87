"""Bodies bounded by triangles."""

from __future__ import annotations

import numpy as np
from scipy.spatial import ConvexHull

CUBE = np.array([[x, y, z] for z in (0.0, 1.0) for y in (0.0, 1.0) for x in (0.0, 1.0)])
SIDES = np.array(
    [[0, 2, 1], [1, 2, 3], [4, 5, 6], [5, 7, 6], [0, 1, 4], [1, 5, 4], [2, 6, 3], [3, 6, 7], [0, 4, 2],
     [2, 4, 6], [1, 3, 5], [3, 7, 5]]
)  # fmt: skip


def ball(count: int, radius: float = 1.0) -> tuple[np.ndarray, np.ndarray]:
    """Points spread evenly over a sphere, and the triangles of their hull."""
    k = np.arange(count) + 0.5
    z, angle = 1.0 - 2.0 * k / count, np.pi * (1.0 + np.sqrt(5.0)) * k
    points = np.column_stack([np.sqrt(1.0 - z**2) * np.cos(angle), np.sqrt(1.0 - z**2) * np.sin(angle), z])
    triangles = ConvexHull(points).simplices
    corner = points[triangles]
    inward = np.einsum("md,md->m", corner[:, 0], np.cross(corner[:, 1], corner[:, 2])) < 0
    triangles[inward] = triangles[inward, ::-1]
    return radius * points, triangles
