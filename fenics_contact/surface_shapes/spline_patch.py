"""Free-form surfaces: splines of degree five through a grid of points."""

from __future__ import annotations

from dataclasses import dataclass, field
from functools import cached_property

import numpy as np
from scipy.interpolate import BSpline, RectBivariateSpline, make_interp_spline

from fenics_contact.display import displayed
from fenics_contact.surface_shapes.patch import Patch
from fenics_contact.surface_shapes.tensor_grid import tensor_grid

DEGREE = 5
#: Distance, relative to the range, from sides that degenerate to a point (poles) at which normals are
#: evaluated.
OFF_POLES = 1e-4


@displayed
@dataclass(frozen=True, eq=False)
class SplinePatch(Patch):
    """A smooth surface through a grid of points, in the plane a curve through a row.

    The parameters are the indices of the points. The body lies behind the normal X₁ × X₂, in the plane to the
    left of the direction of the points. Beyond its border the surface continues straight.

    Attributes:
        grid: Points of the surface, (n₁, n₂, 3) or (n₁, 2), in periodic directions with the first repeated at
            the end.
        periodic: Which directions are smoothly periodic, one boolean each.
        flipped: Whether the body lies on the other side.
    """

    grid: np.ndarray
    periodic: tuple[bool, ...] = ()
    flipped: bool = False
    _poles: tuple[np.ndarray, np.ndarray] = field(init=False, repr=False)

    def __post_init__(self) -> None:
        """Detect the sides that degenerate to a point."""
        grid, counts = self.grid, self.grid.shape[:-1]
        small = 1e-9 * np.ptp(grid.reshape(-1, self.dim), axis=0).max()
        low, high = np.zeros(len(counts)), np.array(counts, dtype=float) - 1
        for axis, count in enumerate(counts):
            for end, bound, sign in ((0, low, 1), (count - 1, high, -1)):
                side = np.take(grid, end, axis=axis).reshape(-1, self.dim)
                if len(side) > 1 and np.ptp(side, axis=0).max() < small:
                    bound[axis] += sign * OFF_POLES * (count - 1)
        object.__setattr__(self, "_poles", (low, high))

    @property
    def dim(self) -> int:
        """Dimension of the space that it lies in."""
        return int(self.grid.shape[-1])

    @property
    def _range(self) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
        return *self._poles, np.array(self.periodic or [False] * (self.dim - 1))

    @property
    def _borders(self) -> tuple[np.ndarray, np.ndarray]:
        # Beyond a pole the surface continues.
        return np.zeros(self.dim - 1), np.array(self.grid.shape[:-1]) - 1.0

    def _starts(self) -> np.ndarray:
        # Between the points: at poles one of two parameters is arbitrary.
        axes = [np.arange(count - 1) + 0.5 for count in self.grid.shape[:-1]]
        return tensor_grid(axes)

    @cached_property
    def _spline(self) -> BSpline | list[RectBivariateSpline]:
        axes = [np.arange(float(count)) for count in self.grid.shape[:-1]]
        if len(axes) == 1:
            return make_interp_spline(axes[0], self.grid, k=DEGREE)
        return [RectBivariateSpline(*axes, self.grid[:, :, k], kx=DEGREE, ky=DEGREE, s=0) for k in range(3)]

    def _derivative(self, u: np.ndarray, *orders: int) -> np.ndarray:
        """Return a derivative of the position, (n, k) -> (n, k + 1)."""
        _, _, periodic = self._range
        u = np.where(periodic, u % (np.array(self.grid.shape[:-1]) - 1), u)
        if isinstance(self._spline, BSpline):
            return np.asarray(self._spline(u[:, 0], orders[0]))
        dx, dy = orders
        return np.stack([spline.ev(u[:, 0], u[:, 1], dx=dx, dy=dy) for spline in self._spline], axis=1)

    def _position(self, u: np.ndarray) -> np.ndarray:
        return self._derivative(u, *[0] * (self.dim - 1))

    def _tangents(self, u: np.ndarray) -> np.ndarray:
        return np.stack([self._derivative(u, *row) for row in np.eye(self.dim - 1, dtype=int)], axis=2)

    def _bends(self, u: np.ndarray) -> np.ndarray:
        rows = np.eye(self.dim - 1, dtype=int)
        columns = [np.stack([self._derivative(u, *(a + b)) for a in rows], axis=2) for b in rows]
        return np.stack(columns, axis=3)
