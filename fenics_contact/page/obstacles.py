"""Rigid obstacles as lines: the edge of the part of a plane beside the bodies, circles of balls and bars."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

import numpy as np


def obstacle_entries(record: Mapping[str, Any], points: np.ndarray) -> list[dict[str, Any]]:
    """Return type and lines of each different rigid obstacle; no lines if it is of another shape.

    Args:
        record: The record of the result, see `fenics_contact.io.read_result`.
        points: All nodes of the bodies, (n, 3).
    """
    scene = record.get("scene") or {}
    masters = [pair.get("master") or {} for pair in scene.get("contacts") or ()]
    different: list[Mapping[str, Any]] = []
    for master in masters:
        if "type" in master and master not in different:
            different.append(master)
    plane = scene.get("dimension") == 2
    return [
        {
            "type": (each.get("obstacle") or each)["type"],
            "lines": [line.tolist() for line in _moved_lines(each, points, plane=plane)],
        }
        for each in different
    ]


def _moved_lines(obstacle: Mapping[str, Any], points: np.ndarray, *, plane: bool) -> list[np.ndarray]:
    """Return the lines of an obstacle where it is, (n, 3) each."""
    if "translation" not in obstacle:
        return _lines(obstacle, points, plane=plane)
    shift, turn = np.zeros(3), np.eye(3)
    given = np.asarray(obstacle["translation"], dtype=float)
    shift[: given.size], turn[: given.size, : given.size] = given, obstacle["rotation"]
    lines = _lines(obstacle["obstacle"], (points - shift) @ turn, plane=plane)
    return [line @ turn.T + shift for line in lines]


def _lines(obstacle: Mapping[str, Any], points: np.ndarray, *, plane: bool) -> list[np.ndarray]:
    """Return the lines of an obstacle, (n, 3) each."""
    given = {
        name: np.pad(np.asarray(obstacle[name], dtype=float), (0, 1 if plane else 0))
        for name in ("point", "normal", "centre", "axis")
        if isinstance(obstacle.get(name), list)
    }
    if {"point", "normal"} <= given.keys():
        return [_edge(given["point"], given["normal"], points, plane=plane)]
    radius = float(obstacle.get("radius") or 0.0)
    if "centre" in given and radius:
        axes = [2] if plane else [0, 1, 2]
        return [_circle(given["centre"], np.eye(3)[axis], radius) for axis in axes]
    if {"point", "axis"} <= given.keys() and radius:
        return _bar(given["point"], given["axis"], radius, points)
    return []


def _across(direction: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Return two unit vectors perpendicular to a unit vector and to each other."""
    first = np.eye(3)[int(np.argmin(np.abs(direction)))]
    first = first - (first @ direction) * direction
    first /= np.linalg.norm(first)
    return first, np.cross(direction, first)


def _edge(
    point: np.ndarray, normal: np.ndarray, points: np.ndarray, *, plane: bool, border: float = 0.06
) -> np.ndarray:
    """Return the edge of the part of a plane that lies under the bodies, in the plane its line."""
    axes = np.stack(_across(normal / np.linalg.norm(normal)))
    if plane:
        axes = np.array([[-normal[1], normal[0], 0.0], [0.0, 0.0, 1.0]])
        axes[0] /= np.linalg.norm(axes[0])
    flat = (points - point) @ axes.T
    margin = border * float(np.ptp(points, axis=0).max())
    (x0, y0), (x1, y1) = flat.min(axis=0) - margin, flat.max(axis=0) + margin
    if plane:
        return np.asarray(point + np.outer([x0, x1], axes[0]))
    return np.asarray(point + np.array([[x0, y0], [x1, y0], [x1, y1], [x0, y1], [x0, y0]]) @ axes)


def _circle(centre: np.ndarray, axis: np.ndarray, radius: float, pieces: int = 96) -> np.ndarray:
    first, second = _across(axis)
    turn = np.linspace(0.0, 2 * np.pi, pieces + 1)
    return np.asarray(centre + radius * (np.outer(np.cos(turn), first) + np.outer(np.sin(turn), second)))


def _bar(point: np.ndarray, axis: np.ndarray, radius: float, points: np.ndarray) -> list[np.ndarray]:
    """Return a circle at each end of the part of a bar beside the bodies, and four lines between them."""
    axis = axis / np.linalg.norm(axis)
    along = (points - point) @ axis
    ends = [point + reach * axis for reach in (along.min(), along.max())]
    first, second = _across(axis)
    sides = (radius * first, radius * second, -radius * first, -radius * second)
    return [
        *(_circle(end, axis, radius) for end in ends),
        *(np.stack([ends[0] + side, ends[1] + side]) for side in sides),
    ]
