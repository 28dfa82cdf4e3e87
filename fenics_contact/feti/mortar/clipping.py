"""Intersections of many pairs of convex polygons at once, cut into triangles; intervals in plane problems.

References:
    Sutherland, I. E., Hodgman, G. W.: Reentrant polygon clipping. Communications of the ACM 17 (1974).
"""

from __future__ import annotations

import numpy as np

from fenics_contact.feti.mortar.planes import measure

#: Area, relative to the smaller of two facets, below which a piece of their intersection is rounding.
NOTHING = 1e-14


def clip(subject: np.ndarray, window: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Cut polygons to convex windows (Sutherland–Hodgman), all pairs at once.

    Args:
        subject: Polygons, shape (n, k, 2).
        window: Convex polygons, counterclockwise, shape (n, corners, 2).

    Returns:
        Vertices in the order of the subject, shape (n, k'), unused ones equal to the first, and their
        numbers, shape (n,), zero where nothing is left.
    """
    vertices, count = subject, np.full(len(subject), subject.shape[1])
    for corner in range(window.shape[1]):
        start, end = window[:, corner], window[:, (corner + 1) % window.shape[1]]
        vertices, count = _half(vertices, count, start, end)
    return vertices, count


def _half(
    vertices: np.ndarray, count: np.ndarray, start: np.ndarray, end: np.ndarray
) -> tuple[np.ndarray, np.ndarray]:
    """Keep what lies on the left of the lines from ``start`` to ``end``."""
    along = (end - start)[:, None]
    away = vertices - start[:, None]
    left = along[:, :, 0] * away[:, :, 1] - along[:, :, 1] * away[:, :, 0]
    # Unused places repeat the first vertex, so the one after the last is the first.
    following, left_then = np.roll(vertices, -1, axis=1), np.roll(left, -1, axis=1)
    used = np.arange(vertices.shape[1]) < count[:, None]
    inside = left >= 0
    crossing = used & (inside != (left_then >= 0))
    fraction = np.divide(left, left - left_then, out=np.zeros_like(left), where=crossing)
    cut = vertices + fraction[:, :, None] * (following - vertices)
    keep = np.stack([used & inside, crossing], axis=2).reshape(len(vertices), -1)
    offered = np.stack([vertices, cut], axis=2).reshape(len(vertices), -1, 2)
    left_over = keep.sum(axis=1)
    clipped = np.zeros((len(vertices), int(left_over.max(initial=0)), 2))
    place = np.cumsum(keep, axis=1) - 1
    row, column = np.nonzero(keep)
    clipped[row, place[row, column]] = offered[row, column]
    unused = np.arange(clipped.shape[1]) >= left_over[:, None]
    return np.where(unused[:, :, None], clipped[:, :1], clipped), left_over


def fan(vertices: np.ndarray, count: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Cut convex polygons into the triangles between their first vertex and the sides opposite to it.

    Args:
        vertices: Shape (n, k, 2), as `clip` returns them.
        count: Numbers of vertices, shape (n,).

    Returns:
        Triangles, shape (m, 3, 2), and the polygon of each, ascending, shape (m,).
    """
    width = max(vertices.shape[1] - 2, 0)
    polygon, second = np.nonzero(np.arange(width) + 2 < count[:, None])
    corner = np.stack([np.zeros_like(second), second + 1, second + 2], axis=1)
    return vertices[polygon[:, None], corner], polygon


def pieces(subject: np.ndarray, window: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Cut the intersections of flat facets into simplices: triangles in space, intervals in the plane.

    Args:
        subject: Flat facets of the master, which turn the other way round, shape (n, k, dim − 1).
        window: Flat facets of the slave, convex, counterclockwise, shape (n, corners, dim − 1).

    Returns:
        Simplices of positive measure, shape (m, dim, dim − 1), and the pair of each, ascending, shape (m,).
    """
    turned = subject[:, ::-1]
    if window.shape[2] == 1:
        low = np.maximum(turned.min(axis=1), window.min(axis=1))
        high = np.minimum(turned.max(axis=1), window.max(axis=1))
        simplices, pair = np.stack([low, np.maximum(low, high)], axis=1), np.arange(len(low))
    else:
        simplices, pair = fan(*clip(turned, window))
    smaller = np.minimum(np.abs(measure(subject)), measure(window))
    real = np.abs(measure(simplices)) > NOTHING * smaller[pair]
    return simplices[real], pair[real]
