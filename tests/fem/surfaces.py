"""Grids of quadrilaterals of 8 nodes on surfaces."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np


def grid(
    along: int, across: int, place: Callable[[np.ndarray], np.ndarray]
) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Return points, quadrilaterals and where the points are in the unit square, which `place` maps."""
    number = np.arange((2 * along + 1) * (2 * across + 1)).reshape(2 * along + 1, 2 * across + 1)
    ticks = np.linspace(0, 1, 2 * along + 1), np.linspace(0, 1, 2 * across + 1)
    at = np.stack(np.meshgrid(*ticks, indexing="ij"), axis=-1).reshape(-1, 2)
    order = [(0, 0), (2, 0), (2, 2), (0, 2), (1, 0), (2, 1), (1, 2), (0, 1)]
    shape = 2 * along - 1, 2 * across - 1
    columns = [number[a : a + shape[0] : 2, b : b + shape[1] : 2].ravel() for a, b in order]
    return place(at), np.stack(columns, axis=1), at


def edges_of(at: np.ndarray) -> dict[str, np.ndarray]:
    """Return the points on the sides of the unit square by name."""
    return {f"{'uv'[k]}{end}": np.flatnonzero(np.isclose(at[:, k], end)) for k in (0, 1) for end in (0, 1)}


def node_at(at: np.ndarray, first: float, second: float) -> int:
    """Return the point at a place of the unit square."""
    return int(np.flatnonzero(np.isclose(at, (first, second)).all(axis=1))[0])
