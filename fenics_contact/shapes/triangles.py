"""The closest point of many triangles, found with a tree of boxes."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from scipy.spatial import cKDTree


@dataclass(frozen=True, eq=False)
class ClosestOnTriangles:
    """Where points are closest to triangles; weights are exactly zero off an edge or corner."""

    triangle: np.ndarray
    weights: np.ndarray
    point: np.ndarray


class TriangleTree:
    """A balanced binary tree of boxes around triangles."""

    def __init__(self, corners: np.ndarray) -> None:
        """Build it from the corners, shape (n, 3, 3), [length].

        Triangles are halved along the longest side of the box of their centres, level by level.
        """
        self._corners = corners
        count = len(corners)
        self._depth = max(int(np.ceil(np.log2(count))), 0)
        leaves = 2**self._depth
        # Missing leaves repeat triangles: every box then has two halves.
        order = np.arange(leaves) * count // leaves
        centres = corners.mean(axis=1)
        for level in range(self._depth):
            order = order.reshape(2**level, -1)
            spread = np.ptp(centres[order], axis=1)
            axis = np.argmax(spread, axis=1)
            along = np.take_along_axis(centres[order], axis[:, None, None], axis=2)[:, :, 0]
            order = np.take_along_axis(order, np.argsort(along, axis=1, kind="stable"), axis=1)
        self._order = order.ravel()
        low, high = corners.min(axis=1)[self._order], corners.max(axis=1)[self._order]
        self._boxes = [(low, high)]
        for _ in range(self._depth):
            low, high = (
                reduce(part.reshape(-1, 2, 3), axis=1) for part, reduce in ((low, np.min), (high, np.max))
            )
            self._boxes.insert(0, (low, high))
        self._vertices = cKDTree(corners.reshape(-1, 3))

    def closest(self, points: np.ndarray) -> ClosestOnTriangles:
        """Return the closest points, of several equally close ones that of the first triangle."""
        bound, nearest = self._vertices.query(points)
        # The triangle of the nearest corner gives a closer bound.
        triangle = nearest // 3
        weights, place = closest_in_triangles(points, self._corners[triangle])
        bound = np.linalg.norm(points - place, axis=1)
        result = ClosestOnTriangles(triangle, weights, place)
        for start in range(0, len(points), 4096):
            part = slice(start, start + 4096)
            self._search(points[part], bound[part], part, result)
        return result

    def _search(
        self,
        points: np.ndarray,
        bound: np.ndarray,
        part: slice,
        result: ClosestOnTriangles,
        chunk: int = 200_000,
    ) -> None:
        """Write the closest points of some points into a result; bounds are distances that suffice.

        `chunk`: pairs of a point and a box that are compared at a time, for the memory.
        """
        who, box = np.arange(len(points)), np.zeros(len(points), dtype=np.int64)
        for level in range(1, self._depth + 1):
            who, box = np.repeat(who, 2), (2 * box[:, None] + np.array([0, 1])).ravel()
            low, high = self._boxes[level]
            near = np.zeros(len(who), dtype=bool)
            for start in range(0, len(who), chunk):
                some = slice(start, start + chunk)
                own = points[who[some]]
                out = np.maximum(np.maximum(low[box[some]] - own, own - high[box[some]]), 0.0)
                near[some] = (out**2).sum(axis=1) <= (bound[who[some]] * (1.0 + 1e-12)) ** 2
            who, box = who[near], box[near]
        triangle = self._order[box]
        keys = np.unique(who * len(self._corners) + triangle)
        who, triangle = keys // len(self._corners), keys % len(self._corners)
        weights, place = closest_in_triangles(points[who], self._corners[triangle])
        far = np.linalg.norm(points[who] - place, axis=1)
        order = np.lexsort((triangle, far, who))
        first = order[np.searchsorted(who[order], np.arange(len(points)))]
        result.triangle[part], result.weights[part] = triangle[first], weights[first]
        result.point[part] = place[first]


def closest_in_triangles(points: np.ndarray, corners: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Return weights of the corners, (n, 3), and the closest point in the triangle of each point, (n, 3).

    The foot in the plane if it lies inside, else the closest point of the nearest edge; weights of corners
    that do not take part are exactly zero.
    """
    first, second = corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0]
    arm = points - corners[:, 0]
    a, b, c = (np.einsum("nd,nd->n", *pair) for pair in ((first, first), (first, second), (second, second)))
    d, e = np.einsum("nd,nd->n", first, arm), np.einsum("nd,nd->n", second, arm)
    area = a * c - b * b
    safe = np.where(area > 0, area, 1.0)
    inner = np.stack([area - (c * d - b * e) - (a * e - b * d), c * d - b * e, a * e - b * d], axis=1)
    inside = (inner > 0).all(axis=1) & (area > 0)
    best = np.where(inside[:, None], inner / safe[:, None], 0.0)
    far = np.where(inside, -1.0, np.inf)
    for one, other in ((0, 1), (1, 2), (2, 0)):
        edge = corners[:, other] - corners[:, one]
        length = np.einsum("nd,nd->n", edge, edge)
        share = np.einsum("nd,nd->n", points - corners[:, one], edge) / np.where(length > 0, length, 1.0)
        share = np.clip(share, 0.0, 1.0)
        away = points - corners[:, one] - share[:, None] * edge
        square = np.einsum("nd,nd->n", away, away)
        closer = square < far
        weights = np.zeros((len(points), 3))
        weights[:, one], weights[:, other] = 1.0 - share, share
        best[closer], far[closer] = weights[closer], square[closer]
    return best, np.einsum("nk,nkd->nd", best, corners)
