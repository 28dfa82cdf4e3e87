"""Rims of designed surfaces and corners of flat sides, put exactly into the planes in which they lie."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import replace
from typing import TypeAlias

import numpy as np

from fenics_contact.io.flat_sides import FlatSide
from fenics_contact.io.spline_fit import CadError, SplineFit

Plane: TypeAlias = tuple[np.ndarray, float]
"""Unit normal, and distance from the origin along it, [length]."""


def corners_in_planes(points: np.ndarray, sides: Sequence[FlatSide]) -> dict[int, np.ndarray]:
    """Return the position of every corner of flat sides in all of their planes, by node.

    Args:
        points: Coordinates of the nodes, shape (n_nodes, dim), [length].
        sides: The flat sides; of a plane body the face itself, whose corners stay.
    """
    planes: dict[int, list[Plane]] = {}
    for side in sides:
        for edge in (edge for loop in side.loops for edge in loop):
            known = planes.setdefault(int(edge.nodes[0]), [])
            if side.normal is not None:
                known.append((side.normal, side.level))
    return {node: _onto(points[node], known) for node, known in planes.items()}


def rims_in_planes(fits: Sequence[SplineFit], sides: Sequence[FlatSide], tolerance: float) -> list[SplineFit]:
    """Return surfaces whose rims lie in the planes of the flat sides that they border on.

    Raises:
        CadError: If a rim is farther off.
    """
    planes: list[dict[int, Plane]] = [{} for _ in fits]
    for side in sides:
        for edge in (edge for loop in side.loops for edge in loop):
            if edge.surface is not None and side.normal is not None:
                planes[edge.surface][edge.side] = side.normal, side.level
    return [_put(fit, known, tolerance) for fit, known in zip(fits, planes, strict=True)]


def _put(fit: SplineFit, planes: Mapping[int, Plane], tolerance: float) -> SplineFit:
    if not planes:
        return fit
    points = fit.points.copy()
    rims = (points[0], points[-1], points[:, 0], points[:, -1])
    for side, (normal, level) in planes.items():
        inner = rims[side][1:-1]
        inner -= np.outer(inner @ normal - level, normal)
    for i, j in ((0, 0), (0, -1), (-1, 0), (-1, -1)):
        both = [planes[side] for side in (-i, 2 - j) if side in planes]
        points[i, j] = _onto(points[i, j], both)
    off = float(np.linalg.norm(points - fit.points, axis=-1).max())
    allowed = tolerance * float(np.ptp(fit.points.reshape(-1, 3), axis=0).max())
    if off > allowed:
        raise CadError(
            f"the rim of a designed surface must stay within {allowed:.3g} of the flat side beside it, it "
            f"leaves it by {off:.3g}: hold it there, as with optimize.fixed_rim, or write the surfaces alone "
            "with solid=False"
        )
    return replace(fit, points=points, deviation=fit.deviation + off)


def _onto(point: np.ndarray, planes: Sequence[Plane]) -> np.ndarray:
    """Return the nearest point in all planes."""
    if not planes:
        return point
    normals = np.array([normal for normal, _ in planes])
    missing = np.array([level for _, level in planes]) - normals @ point
    return np.asarray(point + np.linalg.lstsq(normals, missing, rcond=1e-6)[0], dtype=np.float64)
