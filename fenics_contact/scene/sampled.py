"""A field known at some points, measured or computed by another program, as a function of position."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property

import numpy as np
from scipy.interpolate import RBFInterpolator
from scipy.spatial import KDTree

from fenics_contact.checks import checked
from fenics_contact.display import displayed
from fenics_contact.errors import InvalidInputError
from fenics_contact.scene.values import finite_numbers


@displayed
@dataclass(frozen=True, eq=False)
@checked("points", "values")
class SampledField:
    """A field given by its values at points; use it wherever a function of position is accepted.

    It has the given values at the points. Between them it is interpolated through the nearest ones, by radial
    functions that do not mind how the points lie: on a line, on a curved surface or in a volume. Beyond the
    points it stays near the value of the nearest one, and only as far as ``reach``.

    Attributes:
        points: Coordinates, shape (n, dim), [length]. Points with three of which the last is the same
            everywhere suit plane bodies, too.
        values: A number for each, shape (n,), or a vector, shape (n, dim).
        reach: Largest distance from the nearest point at which it may be asked for, [length]; by default
            twice the largest distance of a point from its nearest neighbour.

    Raises:
        InvalidInputError: If shapes do not fit, numbers are not finite, or a point is given twice.

    Example:
        >>> heights = SampledField([(0, 0, 0), (1, 0, 0), (2, 0, 0)], [0.0, 0.5, 2.0])
        >>> heights(np.array([[1.0, 0.0, 0.0], [0.5, 0.0, 0.0]]))
        array([0.5 , 0.25])
    """

    points: np.ndarray
    values: np.ndarray
    reach: float | None = None

    def __post_init__(self) -> None:
        """Convert to arrays of numbers and reject what is no field."""
        points, values = finite_numbers(self.points), finite_numbers(self.values)
        if points is None or points.ndim != 2 or points.shape[1] not in (2, 3) or len(points) == 0:
            raise InvalidInputError(
                f"SampledField.points must be rows of two or three finite numbers, got "
                f"{_shape(points)}: give one row for each point"
            )
        if values is None or values.shape not in ((len(points),), points.shape):
            raise InvalidInputError(
                f"SampledField.values must be {len(points)} finite numbers, or rows of {points.shape[1]}, "
                f"one for each point, got {_shape(values)}: give a value for each point"
            )
        if self.reach is not None and not (np.isfinite(self.reach) and self.reach > 0):
            raise InvalidInputError(
                f"SampledField.reach must be a length above zero, got {self.reach!r}: give the largest "
                "distance from a point at which its value still holds, or none"
            )
        object.__setattr__(self, "points", points)
        object.__setattr__(self, "values", values)
        self._refuse_doubles()

    def _refuse_doubles(self) -> None:
        order = np.lexsort(self.points.T)
        same = np.flatnonzero((np.diff(self.points[order], axis=0) == 0).all(axis=1))
        if same.size:
            one, other = sorted(order[same[0] : same[0] + 2])
            raise InvalidInputError(
                f"SampledField.points must differ, points {one} and {other} are the same, "
                f"{self.points[one]}, and so are {len(same) - 1} more: give each point once"
            )

    def __call__(self, points: np.ndarray) -> np.ndarray:
        """Evaluate at points, shape (n, dim) -> (n,), or (n, dim) for a vector.

        Raises:
            InvalidInputError: If one is farther than ``reach`` from all given ones, or in another space.
        """
        known, values = self._in_space(points.shape[1])
        self._refuse_far(points, known)
        if len(points) == 0 or len(known) == 1:
            return np.repeat(values[:1], len(points), axis=0)
        return np.asarray(_through(known, values, points))

    def _in_space(self, dim: int) -> tuple[np.ndarray, np.ndarray]:
        """Return points and values for bodies of a dimension."""
        own = self.points.shape[1]
        flat = own == 3 and np.ptp(self.points[:, 2]) == 0
        if own == dim:
            return self.points, self.values
        if dim == 3 or not flat:
            raise InvalidInputError(
                f"SampledField.points must lie in the space of the bodies, they have {own} coordinates and "
                f"the bodies {dim}: give {dim}"
            )
        return self.points[:, :2], self.values[:, :2] if self.values.ndim == 2 else self.values

    def _refuse_far(self, points: np.ndarray, known: np.ndarray) -> None:
        reach = self._reach if self.reach is None else self.reach
        far, _ = KDTree(known).query(points)
        if np.any(far > reach):
            worst = int(np.argmax(far))
            place = ", ".join(f"{x:.6g}" for x in points[worst])
            raise InvalidInputError(
                f"a sampled field must be known where it is used, its nearest point is {far[worst]:.6g} from "
                f"({place}), and it reaches only {reach:.6g}: give values there, or a larger reach"
            )

    @cached_property
    def _reach(self) -> float:
        if len(self.points) == 1:
            return np.inf
        return 2.0 * float(KDTree(self.points).query(self.points, 2)[0][:, 1].max())


def _through(known: np.ndarray, values: np.ndarray, points: np.ndarray, neighbours: int = 32) -> np.ndarray:
    """Return the values at points, interpolated through some nearest known ones."""
    # A kernel of distances alone, with a constant: solvable however the points lie.
    form = RBFInterpolator(known, values, min(neighbours, len(known)), kernel="linear", degree=0)
    return np.asarray(form(points))


def _shape(array: np.ndarray | None) -> str:
    return "something other than finite numbers" if array is None else f"shape {array.shape}"
