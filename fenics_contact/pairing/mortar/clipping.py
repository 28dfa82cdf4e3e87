"""Intersections of many pairs of convex polygons at once, cut into triangles; in the plane intervals.

References:
    Sutherland, I. E., Hodgman, G. W.: Reentrant polygon clipping. Communications of the ACM 17 (1974).
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from fenics_contact.pairing.mortar.sums import SumsBy


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
        vertices, count, _ = _half(vertices, count, start, end)
    return vertices, count


@dataclass(frozen=True)
class _Cut:
    """How polygons were cut along one line each.

    Attributes:
        vertices: Vertices before, shape (n, k, 2).
        start: A point of the line, shape (n, 2).
        along: From there to another one, shape (n, 2).
        left: Positions of the vertices, positive on the left, shape (n, k).
        crossing: Whether the line cuts the side from a vertex to the next, shape (n, k).
        kept: Polygon, place among vertices and cuts by turns, and place in the result of what is kept.
        count: Numbers of vertices of the result, shape (n,).
    """

    vertices: np.ndarray
    start: np.ndarray
    along: np.ndarray
    left: np.ndarray
    crossing: np.ndarray
    kept: tuple[np.ndarray, np.ndarray, np.ndarray]
    count: np.ndarray


def _half(
    vertices: np.ndarray, count: np.ndarray, start: np.ndarray, end: np.ndarray
) -> tuple[np.ndarray, np.ndarray, _Cut]:
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
    clipped: np.ndarray = np.zeros((len(vertices), int(left_over.max(initial=0)), 2))
    row, column = np.nonzero(keep)
    place = (np.cumsum(keep, axis=1) - 1)[row, column]
    clipped[row, place] = offered[row, column]
    unused = np.arange(clipped.shape[1]) >= left_over[:, None]
    clipped = np.where(unused[:, :, None], clipped[:, :1], clipped)
    cut_by = _Cut(vertices, start, along[:, 0], left, crossing, (row, column, place), left_over)
    return clipped, left_over, cut_by


def clip_pulled_back(
    subject: np.ndarray, window: np.ndarray, by_vertices: np.ndarray
) -> tuple[np.ndarray, np.ndarray]:
    """Vector-Jacobian product of `clip` with respect to polygons and windows.

    Args:
        subject: Polygons or intervals as for `clip`.
        window: Windows as for `clip`.
        by_vertices: Derivative by the vertices, zero for unused ones and those left out, shape (n, any
            number, dim − 1).

    Returns:
        In the shapes of ``subject`` and ``window``.
    """
    if window.shape[2] == 1:
        return _interval_pulled_back(subject, window, by_vertices)
    vertices, count, cuts = subject, np.full(len(subject), subject.shape[1]), []
    for corner in range(window.shape[1]):
        start, end = window[:, corner], window[:, (corner + 1) % window.shape[1]]
        vertices, count, cut = _half(vertices, count, start, end)
        cuts.append(cut)
    by_window, by = np.zeros_like(window), np.zeros_like(vertices)
    width = min(by.shape[1], by_vertices.shape[1])
    by[:, :width] = by_vertices[:, :width]
    for corner in reversed(range(window.shape[1])):
        by, by_start, by_end = _half_pulled_back(cuts[corner], by)
        by_window[:, corner] += by_start
        by_window[:, (corner + 1) % window.shape[1]] += by_end
    return by, by_window


def _half_pulled_back(cut: _Cut, by_clipped: np.ndarray) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Return the derivatives by the vertices before a cut, and by both points of the line."""
    count, width = cut.left.shape
    by_clipped = by_clipped.copy()
    unused = np.arange(by_clipped.shape[1]) >= cut.count[:, None]
    by_clipped[:, :1] += np.where(unused[:, :, None], by_clipped, 0.0).sum(axis=1, keepdims=True)
    row, column, place = cut.kept
    by_offered = np.zeros((count, 2 * width, 2))
    by_offered[row, column] = by_clipped[row, place]
    by_vertices = by_offered[:, 0::2].copy()
    row, here = np.nonzero(cut.crossing)
    then, by_point = (here + 1) % width, by_offered[row, 2 * here + 1]
    left, left_then = cut.left[row, here], cut.left[row, then]
    # The cut is x + s (x' − x) with s = l / (l − l').
    share, slope = left / (left - left_then), 1.0 / (left - left_then) ** 2
    vertex, following = cut.vertices[row, here], cut.vertices[row, then]
    by_share = slope * np.einsum("nd,nd->n", by_point, following - vertex)
    by_left, by_then = (-left_then * by_share)[:, None], (left * by_share)[:, None]
    across = np.stack([-cut.along[row, 1], cut.along[row, 0]], axis=1)
    by_vertices[row, here] += (1 - share)[:, None] * by_point + by_left * across
    by_vertices[row, then] += share[:, None] * by_point + by_then * across
    lever = by_left * (vertex - cut.start[row]) + by_then * (following - cut.start[row])
    by_end = np.stack([lever[:, 1], -lever[:, 0]], axis=1)
    over_polygons = SumsBy(row, count)
    by_start = over_polygons(-(by_left + by_then) * across - by_end)
    return by_vertices, by_start, over_polygons(by_end)


def _interval_pulled_back(
    subject: np.ndarray, window: np.ndarray, by_ends: np.ndarray
) -> tuple[np.ndarray, np.ndarray]:
    """Give the derivatives by the ends of intersections to the ends that they are."""
    ends, each = np.concatenate([subject, window], axis=1)[:, :, 0], np.arange(len(subject))
    low, high = (
        np.stack([find(ends[:, :2], axis=1), 2 + find(ends[:, 2:], axis=1)])
        for find in (np.argmin, np.argmax)
    )
    by = np.zeros(ends.shape)
    by[each, np.where(ends[each, low[0]] >= ends[each, low[1]], *low)] += by_ends[:, 0, 0]
    by[each, np.where(ends[each, high[0]] <= ends[each, high[1]], *high)] += by_ends[:, 1, 0]
    return by[:, :2, None], by[:, 2:, None]


def simplices(vertices: np.ndarray, count: np.ndarray) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Cut convex polygons into triangles between their first vertex and the opposite sides.

    Args:
        vertices: Polygons, shape (n, k, 2), or intervals, shape (n, 2, 1), as `clip` returns them.
        count: Numbers of vertices, shape (n,).

    Returns:
        Triangles, shape (m, 3, 2), or intervals, shape (m, 2, 1), which of the given polygons or intervals
        each belongs to, ascending, shape (m,), and which of its vertices are the corners, shape (m, dim).
    """
    if vertices.shape[2] == 1:
        chosen = np.flatnonzero(count)
        return vertices[chosen], chosen, np.tile([0, 1], (len(chosen), 1))
    width = max(vertices.shape[1] - 2, 0)
    polygon, second = np.nonzero(np.arange(width) + 2 < count[:, None])
    corner = np.stack([np.zeros_like(second), second + 1, second + 2], axis=1)
    return vertices[polygon[:, None], corner], polygon, corner
