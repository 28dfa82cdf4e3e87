"""Smooth curves through given points of the plane."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from functools import cached_property
from typing import TYPE_CHECKING

import numpy as np

from fenics_contact._base.checks import GivenVector, checked
from fenics_contact._base.display import displayed
from fenics_contact.errors import InvalidInputError
from fenics_contact.shapes.parametric import Patch

if TYPE_CHECKING:
    from scipy.interpolate import CubicSpline

#: Samples between two points.
SAMPLES = 8


@displayed
@dataclass(frozen=True)
@checked()
class Profile(Patch):
    """A cubic spline through points of the plane, with continuous curvature; for `Extruded` and `Revolved`.

    The body lies to the left of the curve's direction: counterclockwise around it. Beyond its ends the curve
    continues straight.

    Attributes:
        points: At least three points, two coordinates each, in the order of the curve, [length].
        closed: Whether the curve continues from the last point to the first.
        flipped: Whether the body lies on the other side.

    Example:
        >>> import numpy as np
        >>> from fenics_contact.shapes import Profile
        >>> arch = Profile([(2.0, 0.0), (0.0, 1.0), (-2.0, 0.0)])
        >>> arch.distance(np.array([[0.0, 1.25]])).round(6)
        array([0.25])
    """

    points: Sequence[GivenVector]
    closed: bool = False
    flipped: bool = False

    def __post_init__(self) -> None:
        """Reject points that are too few, not in the plane, or equal to the one before."""
        known = all(len(point) == 2 for point in self.points) and np.isfinite(self.points).all()
        if len(self.points) < 3 or not known or not self._lengths.all():
            raise InvalidInputError(
                f"Profile.points must be three or more different points in the plane, got {self.points!r}"
            )

    @property
    def dim(self) -> int:
        """Dimension of the space that it lies in, 2."""
        return 2

    @property
    def _corners(self) -> np.ndarray:
        corners = np.asarray(self.points, dtype=np.float64)
        return np.concatenate([corners, corners[:1]]) if self.closed else corners

    @property
    def _lengths(self) -> np.ndarray:
        return np.asarray(np.linalg.norm(np.diff(self._corners, axis=0), axis=1))

    @cached_property
    def _spline(self) -> CubicSpline:
        from scipy.interpolate import CubicSpline  # few bodies need it

        along = np.concatenate([[0.0], np.cumsum(self._lengths)])
        kind = "periodic" if self.closed else "not-a-knot"
        return CubicSpline(along, self._corners, bc_type=kind)

    @property
    def _range(self) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
        knots = self._spline.x
        return knots[:1], knots[-1:], np.array([self.closed])

    def _starts(self) -> np.ndarray:
        knots = self._spline.x
        share = np.arange(SAMPLES) / SAMPLES
        inner = (knots[:-1, None] + np.diff(knots)[:, None] * share).ravel()
        return np.append(inner, knots[-1])[:, None]

    def _position(self, u: np.ndarray) -> np.ndarray:
        return np.asarray(self._spline(u[:, 0]))

    def _tangents(self, u: np.ndarray) -> np.ndarray:
        return np.asarray(self._spline(u[:, 0], 1)[:, :, None])

    def _bends(self, u: np.ndarray) -> np.ndarray:
        return np.asarray(self._spline(u[:, 0], 2)[:, :, None, None])
