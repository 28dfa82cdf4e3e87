"""A designed surface as the B-spline that CAD programs know."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np
from scipy.interpolate import BSpline, make_interp_spline

from fenics_contact.errors import InvalidDesignError
from fenics_contact.surface_shapes import tensor_grid

if TYPE_CHECKING:
    from fenics_contact.shape import MovedSurface

DEGREE = 5


class CadError(InvalidDesignError):
    """A design has no surface, or no body, that a CAD file can hold; the message says why."""


@dataclass(frozen=True, eq=False)
class SplineFit:
    """A B-spline of degree five with the same clamped knots along all parameters, from 0 to 1.

    Attributes:
        points: Control points, (n, n, 3), of a curve in the plane (n, 2), [length].
        knots: Knots, each as often as it counts, (n + 6,).
        deviation: Largest distance from the surface, at points between those that it interpolates, [length].
    """

    points: np.ndarray
    knots: np.ndarray
    deviation: float

    @property
    def sides(self) -> tuple[np.ndarray, ...]:
        """Control points of the sides s = 0, s = 1, t = 0, t = 1, or of the curve itself, (n, 3 | 2)."""
        if self.points.ndim == 2:
            return (self.points,)
        return self.points[0], self.points[-1], self.points[:, 0], self.points[:, -1]


def fitted(surface: MovedSurface, tolerance: float, most: int = 129) -> SplineFit:
    """Interpolate a moved surface by a B-spline, with more points until it is close enough.

    Raises:
        CadError: If the surface folds, or that many points are not enough.
    """
    count, axes = 17, len(surface.ticks)
    allowed = tolerance * float(np.ptp(surface.after(surface.parameters), axis=0).max())
    while True:
        finer = _sampled(surface, 2 * count - 1)
        knots, points = _interpolated(finer[(slice(None, None, 2),) * axes])
        deviation = float(np.linalg.norm(_values(knots, points, 2 * count - 1) - finer, axis=-1).max())
        if deviation <= allowed:
            _require_unfolded(surface, finer)
            return SplineFit(points, knots, deviation)
        if 2 * count - 1 > most:
            raise CadError(
                f"the B-spline of the surface on {surface.design.body!r} must be within {allowed:.3g} of it, "
                f"{count} points along each parameter leave {deviation:.3g}: the surface has kinks; give a "
                "larger tolerance or a smoother reference"
            )
        count = 2 * count - 1


def _sampled(surface: MovedSurface, count: int) -> np.ndarray:
    """Return points of the moved surface at equal steps, (count, count, 3) or (count, 2)."""
    places = _places(count, len(surface.ticks))
    return surface.after(places).reshape(*[count] * len(surface.ticks), -1)


def _places(count: int, axes: int) -> np.ndarray:
    return tensor_grid([np.linspace(0.0, 1.0, count)] * axes)


def _interpolated(values: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Return knots and control points of the spline through values at equal steps."""
    points, knots = values, np.zeros(0)
    for axis in range(values.ndim - 1):
        spline = make_interp_spline(np.linspace(0.0, 1.0, len(values)), np.moveaxis(points, axis, 0), DEGREE)
        points, knots = np.moveaxis(spline.c, 0, axis), spline.t
    return knots, points


def _values(knots: np.ndarray, points: np.ndarray, count: int) -> np.ndarray:
    for axis in range(points.ndim - 1):
        along = BSpline(knots, np.moveaxis(points, axis, 0), DEGREE)(np.linspace(0.0, 1.0, count))
        points = np.moveaxis(along, 0, axis)
    return points


def _require_unfolded(surface: MovedSurface, after: np.ndarray) -> None:
    """Refuse a surface whose normals turn over: it was moved farther than its radius of curvature."""
    count, axes = len(after), len(surface.ticks)
    before = surface.before(_places(count, axes)).reshape(after.shape)
    now, then = (_orientations(each) for each in (after, before))
    turned = np.einsum("...d,...d->...", now, then) < 0
    if turned.any():
        at = _places(count, axes)[np.argmax(turned)]
        where = ", ".join(f"{name} = {place:.3g}" for name, place in zip("st", at, strict=False))
        raise CadError(
            f"the surface that a design moves on {surface.design.body!r} must not fold over itself, it does "
            f"at {where}: bound the movement by less than the radius of curvature"
        )


def _orientations(grid: np.ndarray) -> np.ndarray:
    """Return normals, in the plane tangents, at points of a grid, of any length."""
    if grid.ndim == 2:
        return np.gradient(grid, axis=0)
    return np.cross(np.gradient(grid, axis=0), np.gradient(grid, axis=1))
