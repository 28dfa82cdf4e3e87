"""Lines of the rigid obstacles that a record of results describes."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

import numpy as np

from fenics_contact.pictures.drawing import outline, tool_at, turned_shape
from fenics_contact.shapes.combined import placed, simplified
from fenics_contact.shapes.rounded import Box, Cone
from fenics_contact.shapes.simple import Cylinder, Plane, Sphere, SurfaceShape, Torus

#: What describes a shape in a record, the larger sets first.
_SHAPES: tuple[tuple[tuple[str, ...], type], ...] = (
    (("tip", "axis", "half_angle", "radius"), Cone),
    (("centre", "axis", "ring_radius", "tube_radius"), Torus),
    (("centre", "size", "radius", "rotation"), Box),
    (("centre", "size", "radius"), Box),
    (("point", "axis", "radius"), Cylinder),
    (("centre", "radius"), Sphere),
    (("point", "normal"), Plane),
)


def obstacle_entries(
    record: Mapping[str, Any], points: np.ndarray, *, turned: bool = False
) -> list[dict[str, Any]]:
    """Return type and lines of each different rigid obstacle; no lines if it is of another shape.

    `turned`: whether sections were turned around their axis.
    """
    scene = record.get("scene") or {}
    dim = 3 if turned else int(scene.get("dimension") or 3)
    different: list[Mapping[str, Any]] = []
    for pair in scene.get("contacts") or ():
        master = pair.get("master") or {}
        if "type" in master and master not in different:
            different.append(master)
    return [
        {
            "type": (each.get("obstacle") or each)["type"],
            "lines": [
                np.pad(line, ((0, 0), (0, 3 - dim))).tolist()
                for line in _obstacle_lines(each, points[:, :dim], record.get("tools") or {}, turned)
            ],
        }
        for each in different
    ]


def _obstacle_lines(
    entry: Mapping[str, Any], points: np.ndarray, tools: Mapping[str, Any], turned: bool
) -> list[np.ndarray]:
    """Return the lines of an obstacle where it is."""
    shape = _shape(entry.get("obstacle") or entry.get("shape") or entry)
    if shape is None:
        return []
    tool = tools.get(entry.get("name", "")) if "at" in entry else None
    if tool is not None:
        shape = tool_at(shape, np.asarray(entry["at"]), tool["rotation"], np.asarray(tool["displacement"]))
    if "translation" in entry:
        shape = simplified(placed(shape, np.asarray(entry["rotation"]), entry["translation"]))
    return outline(turned_shape(shape) if turned else shape, points)


def _shape(entry: Mapping[str, Any]) -> SurfaceShape | None:
    """Return the shape that an entry of a record describes, None if it is of none that is drawn."""
    for names, kind in _SHAPES:
        if all(isinstance(entry.get(name), list | float | int) for name in names):
            shape: SurfaceShape = kind(**{name: entry[name] for name in names})
            return shape
    return None
