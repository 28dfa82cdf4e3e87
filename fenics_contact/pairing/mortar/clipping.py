"""Intersections of many pairs of convex polygons at once, cut into triangles; in the plane intervals.

References:
    Sutherland, I. E., Hodgman, G. W.: Reentrant polygon clipping. Communications of the ACM 17 (1974).
"""

from __future__ import annotations

import numpy as np


def clip(subject: np.ndarray, window: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Clip polygons to convex windows (Sutherland–Hodgman), all pairs at once; intervals to intervals.

    Args:
        subject: Polygons, shape (n, k, 2), or intervals, shape (n, 2, 1).
        window: Convex polygons, counterclockwise, shape (n, m, 2), or intervals, shape (n, 2, 1). Vertices
            may be repeated.

    Returns:
        Vertices in the order of the subject, shape (n, k', 2) or (n, 2, 1), unused ones equal to the first,
        and their numbers, shape (n,), zero for empty intersections.
    """
    if window.shape[2] == 1:
        low = np.maximum(subject.min(axis=1), window.min(axis=1))
        high = np.minimum(subject.max(axis=1), window.max(axis=1))
        count = np.where(high > low, 2, 0)[:, 0]
        return np.stack([low, np.maximum(low, high)], axis=1), count
    vertices, count = subject, np.full(len(subject), subject.shape[1])
    for corner in range(window.shape[1]):
        start, end = window[:, corner], window[:, (corner + 1) % window.shape[1]]
        vertices, count = _half(vertices, count, start, end)
    return vertices, count


def _half(
    vertices: np.ndarray, count: np.ndarray, start: np.ndarray, end: np.ndarray
) -> tuple[np.ndarray, np.ndarray]:
    """Keep the part to the left of the lines from ``start`` to ``end``."""
    along = (end - start)[:, None]
    away = vertices - start[:, None]
    left = along[:, :, 0] * away[:, :, 1] - along[:, :, 1] * away[:, :, 0]
    # Unused entries repeat the first vertex, so the one after the last is the first.
    following, left_then = np.roll(vertices, -1, axis=1), np.roll(left, -1, axis=1)
    used = np.arange(vertices.shape[1]) < count[:, None]
    inside = left >= 0
    crossing = used & (inside != (left_then >= 0))
    fraction = np.divide(left, left - left_then, out=np.zeros_like(left), where=crossing)
    cut = vertices + fraction[:, :, None] * (following - vertices)
    places = 2 * vertices.shape[1]
    keep = np.stack([used & inside, crossing], axis=2).reshape(len(vertices), places)
    offered = np.stack([vertices, cut], axis=2).reshape(len(vertices), places, 2)
    left_over = keep.sum(axis=1)
    clipped = np.zeros((len(vertices), int(left_over.max(initial=0)), 2))
    place = np.cumsum(keep, axis=1) - 1
    row, column = np.nonzero(keep)
    clipped[row, place[row, column]] = offered[row, column]
    unused = np.arange(clipped.shape[1]) >= left_over[:, None]
    return np.where(unused[:, :, None], clipped[:, :1], clipped), left_over


def simplices(vertices: np.ndarray, count: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Cut convex polygons into triangles between their first vertex and the opposite sides.

    Args:
        vertices: Polygons, shape (n, k, 2), or intervals, shape (n, 2, 1), as `clip` returns them.
        count: Numbers of vertices, shape (n,).

    Returns:
        Triangles, shape (m, 3, 2), or intervals, shape (m, 2, 1), and which of the given polygons or
        intervals each belongs to, ascending, shape (m,).
    """
    if vertices.shape[2] == 1:
        return vertices[count > 0], np.flatnonzero(count)
    width = max(vertices.shape[1] - 2, 0)
    polygon, second = np.nonzero(np.arange(width) + 2 < count[:, None])
    corner = np.stack([np.zeros_like(second), second + 1, second + 2], axis=1)
    return vertices[polygon[:, None], corner], polygon
