"""Rigid obstacles of a page as lines, from the record of a result."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

import numpy as np

from fenics_contact.surface_shapes import Cylinder, Plane, Sphere, SurfaceShape, placed, simplified
from fenics_contact.viz import outline

#: What describes a shape in a record, the larger sets first.
_SHAPES: tuple[tuple[tuple[str, ...], type], ...] = (
    (("point", "axis", "radius"), Cylinder),
    (("centre", "radius"), Sphere),
    (("point", "normal"), Plane),
)


def obstacle_entries(record: Mapping[str, Any], points: np.ndarray) -> list[dict[str, Any]]:
    """Return type and lines of each different rigid obstacle; no lines if it is of another shape.

    Args:
        record: The record of the result, see `fenics_contact.io.read_result`.
        points: All nodes of the bodies, (n, 3).
    """
    scene = record.get("scene") or {}
    dim = int(scene.get("dimension") or 3)
    different: list[Mapping[str, Any]] = []
    for pair in scene.get("contacts") or ():
        master = pair.get("master") or {}
        if "type" in master and master not in different:
            different.append(master)
    return [
        {
            "type": (each.get("obstacle") or each)["type"],
            "lines": [
                np.pad(line, ((0, 0), (0, 3 - dim))).tolist() for line in _lines(each, points[:, :dim])
            ],
        }
        for each in different
    ]


def _lines(entry: Mapping[str, Any], points: np.ndarray) -> list[np.ndarray]:
    shape = _shape(entry.get("obstacle") or entry)
    if shape is None:
        return []
    if "translation" in entry:
        shape = simplified(placed(shape, np.asarray(entry["rotation"]), entry["translation"]))
    return outline(shape, points)


def _shape(entry: Mapping[str, Any]) -> SurfaceShape | None:
    """Return the shape that an entry of a record describes, None if it is of none that is drawn."""
    for names, kind in _SHAPES:
        if all(isinstance(entry.get(name), list | float | int) for name in names):
            shape: SurfaceShape = kind(**{name: entry[name] for name in names})
            return shape
    return None
