"""The amplitude of a path of vectors on a plane: the radius of the smallest circle around it."""

from __future__ import annotations

import numpy as np


class _Column:
    """Columns of arrays of circles: squares of radii, centres, states whose points are on them, and shares.

    Of these states the last two are the same where there are two; a share is how much of the centre a point
    is.
    """

    square, centre, support, share = 0, slice(1, 3), slice(3, 6), slice(6, 9)


def smallest_circles(paths: np.ndarray, rounding: float = 1e-12) -> tuple[np.ndarray, np.ndarray]:
    """Return the radii of the smallest circles around paths, exact, and their derivatives by the points.

    The point farthest outside a circle is on the smallest one around it and the points of the last (Elzinga,
    Hearn, Transportation Science 6 (1972) 379-394). Circles grow, so that this ends, with the smallest around
    all. `paths`: shape (n_states, n, 1 or 2); `rounding`: relative distance that is not outside.
    """
    every, width = np.arange(paths.shape[1]), paths.shape[2]
    points = np.pad(paths - paths.mean(axis=0), ((0, 0), (0, 0), (0, 2 - width)))
    squares = (points**2).sum(axis=2)
    first, least = squares.argmax(axis=0), squares.max(axis=0) * rounding**2
    second = ((points - points[first, every]) ** 2).sum(axis=2).argmax(axis=0)
    support = np.stack([first, second, second])
    found, active = _through(points[support, every], support), every
    while active.size:
        squares = ((points[:, active] - found[active, _Column.centre]) ** 2).sum(axis=2)
        outside = squares.max(axis=0) > found[active, _Column.square] * (1.0 + rounding) + least[active]
        active, far = active[outside], squares.argmax(axis=0)[outside]
        support = np.vstack([far, found[active, _Column.support].T.astype(int)])
        larger = _around_four(points[support, active], support, 100.0 * rounding)
        # Rounding alone keeps the last circle.
        grown = larger[:, _Column.square] > found[active, _Column.square]
        active = active[grown]
        found[active] = larger[grown]
    radius, slope = np.sqrt(found[:, _Column.square]), np.zeros_like(points)
    scale = np.where(radius > 0.0, radius, np.inf)[:, None]
    for state, share in zip(found[:, _Column.support].T.astype(int), found[:, _Column.share].T, strict=True):
        slope[state, every] += share[:, None] * (points[state, every] - found[:, _Column.centre]) / scale
    return radius, slope[..., :width]


def _through(points: np.ndarray, support: np.ndarray) -> np.ndarray:
    """Return the circles through three points, (3, n, 2); on two, where the last are the same.

    Those through three in line have infinite radii.
    """
    a, b = points[1:] - points[0]
    aa, bb = (a**2).sum(axis=1), (b**2).sum(axis=1)
    area, pair = a[:, 0] * b[:, 1] - a[:, 1] * b[:, 0], support[1] == support[2]
    flat = np.abs(area) <= 1e-14 * np.sqrt(aa * bb)
    area = np.where(flat, 1.0, area)
    away = np.stack([b[:, 1] * aa - a[:, 1] * bb, a[:, 0] * bb - b[:, 0] * aa], axis=1) / (2 * area[:, None])
    away = np.where(pair[:, None], 0.5 * a, away)
    second = np.where(pair, 0.5, (away[:, 0] * b[:, 1] - away[:, 1] * b[:, 0]) / area)
    third = np.where(pair, 0.0, (a[:, 0] * away[:, 1] - a[:, 1] * away[:, 0]) / area)
    square = np.where(flat & ~pair, np.inf, (away**2).sum(axis=1))
    return np.column_stack([square, points[0] + away, support.T, 1.0 - second - third, second, third])


def _around_four(points: np.ndarray, support: np.ndarray, rounding: float) -> np.ndarray:
    """Return the smallest circles around four points, (4, n, 2), through the first; none have no radius."""
    best = _through(points[[0, 0, 0]], support[[0, 0, 0]])
    for chosen in ([0, 1, 1], [0, 2, 2], [0, 3, 3], [0, 1, 2], [0, 1, 3], [0, 2, 3]):
        tried = _through(points[chosen], support[chosen])
        most = ((points - tried[:, _Column.centre]) ** 2).sum(axis=2).max(axis=0)
        smaller = (tried[:, _Column.square] < best[:, _Column.square]) | (best[:, _Column.square] == 0.0)
        better = (most <= tried[:, _Column.square] * (1.0 + rounding)) & smaller
        best = np.where(better[:, None], tried, best)
    return best
