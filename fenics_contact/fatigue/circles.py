"""The amplitude of a path of vectors on a plane: the radius of the smallest circle around it."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np


@dataclass(frozen=True, eq=False)
class Circles:
    """Circles around paths.

    `square`: of their radii, (n,); `centre`: (n, 2); `support`: states whose points are on them, one twice
    where there are two, (n, 3); `share`: how much of the centre each of these points is, (n, 3).
    """

    square: np.ndarray
    centre: np.ndarray
    support: np.ndarray
    share: np.ndarray

    def by_points(self, paths: np.ndarray) -> np.ndarray:
        """Return the derivative of the radii by the points, shape of the paths: Σ share (x − c) / radius."""
        found, every = np.zeros_like(paths), np.arange(paths.shape[1])
        scale = np.where(self.square > 0.0, np.sqrt(self.square), np.inf)[:, None]
        for state, share in zip(self.support.T, self.share.T, strict=True):
            away = paths[state, every] - self.centre[:, : paths.shape[2]]
            found[state, every] += share[:, None] * away / scale
        return found

    def put(self, where: np.ndarray, other: Circles, chosen: np.ndarray) -> None:
        """Overwrite some by chosen others."""
        for name, values in vars(self).items():
            values[where] = getattr(other, name)[chosen]


def smallest_circles(paths: np.ndarray, rounding: float = 1e-12) -> Circles:
    """Return the smallest circles around paths, shape (n_states, n, 1 or 2), exact, for all at once.

    The point farthest outside a circle is on the smallest one around it and the points of the last (Elzinga,
    Hearn, Transportation Science 6 (1972) 379-394). Circles grow, so that this ends, with the smallest around
    all. `rounding`: relative distance that is not outside.
    """
    every, origin = np.arange(paths.shape[1]), paths.mean(axis=0)
    points = np.pad(paths - origin, ((0, 0), (0, 0), (0, 2 - paths.shape[2])))
    squares = (points**2).sum(axis=2)
    first, least = squares.argmax(axis=0), squares.max(axis=0) * rounding**2
    second = ((points - points[first, every]) ** 2).sum(axis=2).argmax(axis=0)
    support = np.stack([first, second, second])
    found, active = _through(points[support, every], support), every
    while active.size:
        squares = ((points[:, active] - found.centre[active]) ** 2).sum(axis=2)
        outside = squares.max(axis=0) > found.square[active] * (1.0 + rounding) + least[active]
        active, far = active[outside], squares.argmax(axis=0)[outside]
        support = np.vstack([far, found.support[active].T])
        larger = _around_four(points[support, active], support, 100.0 * rounding)
        grown = larger.square > found.square[active]  # rounding alone keeps the last circle
        active = active[grown]
        found.put(active, larger, grown)
    found.centre[:, : paths.shape[2]] += origin
    return found


def _through(points: np.ndarray, support: np.ndarray) -> Circles:
    """Return the circles through three points, (3, n, 2), or on two, where the last are the same.

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
    share = np.stack([1.0 - second - third, second, third], axis=1)
    return Circles(square, points[0] + away, np.array(support.T), share)


def _around_four(points: np.ndarray, support: np.ndarray, rounding: float) -> Circles:
    """Return the smallest circles around four points, (4, n, 2), through the first; none have no radius."""
    best = _through(points[[0, 0, 0]], support[[0, 0, 0]])
    for chosen in ([0, 1, 1], [0, 2, 2], [0, 3, 3], [0, 1, 2], [0, 1, 3], [0, 2, 3]):
        tried = _through(points[chosen], support[chosen])
        most = ((points - tried.centre) ** 2).sum(axis=2).max(axis=0)
        smaller = (tried.square < best.square) | (best.square == 0.0)
        best.put(better := (most <= tried.square * (1.0 + rounding)) & smaller, tried, better)
    return best
