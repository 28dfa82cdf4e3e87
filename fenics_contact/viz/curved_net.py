"""A control net whose bars follow its surface."""

from __future__ import annotations

import numpy as np

#: Straight pieces between two control points.
PIECES = 8


def curved_net(grid: np.ndarray, net: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Return the bars of a net as polylines that follow the surface instead of cutting through it.

    Control point (i, j) belongs to the surface's parameters (i / (n_s - 1), j / (n_t - 1)). The offset of a
    bar from the surface is linear along the bar, so that it ends at its control points.

    Args:
        grid: Nodes of the surface in the order of its parameters, (m_s, m_t, 3), [length].
        net: Control points, (n_s, n_t, 3), [length].

    Returns:
        Points, (n, 3), [length], and pairs of them, (n_edges, 2).
    """
    fine = [np.linspace(0, count - 1, PIECES * (count - 1) + 1) for count in net.shape[:2]]
    stations = zip(fine, net.shape[:2], grid.shape[:2], strict=True)
    rows, columns = (_hats(_parameters(x, count) * (nodes - 1), nodes) for x, count, nodes in stations)
    surface = np.einsum("ri,cj,ijd->rcd", rows, columns, grid)
    above = net - surface[::PIECES, ::PIECES]
    rows, columns = (_hats(x, count) for x, count in zip(fine, net.shape[:2], strict=True))
    points = surface + np.einsum("ri,cj,ijd->rcd", rows, columns, above)
    number = np.arange(points.shape[0] * points.shape[1]).reshape(points.shape[:2])
    along, across = number[:, ::PIECES], number[::PIECES]
    pairs = np.stack([along[:-1], along[1:]], axis=-1), np.stack([across[:, :-1], across[:, 1:]], axis=-1)
    return points.reshape(-1, 3), np.concatenate([pair.reshape(-1, 2) for pair in pairs])


def _parameters(places: np.ndarray, count: int) -> np.ndarray:
    """Return the surface's parameters of control points; a single one lies in the middle."""
    return places / (count - 1) if count > 1 else np.full(len(places), 0.5)


def _hats(places: np.ndarray, count: int) -> np.ndarray:
    """Return the piecewise linear hat functions of 0 .. count - 1 at some points, (n, count)."""
    return np.maximum(0.0, 1.0 - np.abs(places[:, None] - np.arange(count)))
