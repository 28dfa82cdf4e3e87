"""Shapes given by a function that returns the signed distance."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np

from fenics_contact.checks import checked
from fenics_contact.errors import InvalidInputError
from fenics_contact.surface_shapes.differences import differences

#: Tolerance of the length of a distance's gradient, which is one.
SLOPE_TOLERANCE = 0.05


@dataclass(frozen=True)
@checked()
class SignedDistance:
    """A shape given by a function.

    Attributes:
        function: Signed distance, negative inside, (n, dim) -> (n,), [length]; smooth where bodies touch.
        gradient: Its gradient, (n, dim) -> (n, dim); central differences if it is None.
    """

    function: Callable[[np.ndarray], np.ndarray]
    gradient: Callable[[np.ndarray], np.ndarray] | None = None

    def distance(self, points: np.ndarray) -> np.ndarray:
        """Return the function's values.

        Raises:
            InvalidInputError: If they are not one finite number per point.
        """
        values = np.asarray(self.function(points), dtype=np.float64)
        if values.shape != (len(points),) or not np.isfinite(values).all():
            raise InvalidInputError(
                f"the distance of {type(self).__name__} must be one finite number per point, shape "
                f"({len(points)},), got shape {values.shape} or NaN: write it for an array of points, "
                "(n, dim) -> (n,)"
            )
        return values

    def normals(self, points: np.ndarray) -> np.ndarray:
        """Return the gradient at unit length.

        Raises:
            InvalidInputError: If its length is not one, as the function is not a distance, or its shape is
                wrong.
        """
        slope = differences(self.distance, points) if self.gradient is None else self.gradient(points)
        slope = np.asarray(slope, dtype=np.float64)
        if slope.shape != points.shape:
            raise InvalidInputError(
                f"the gradient of {type(self).__name__} must have shape {points.shape} like the points, got "
                f"{slope.shape}: write it for an array of points, (n, dim) -> (n, dim)"
            )
        length = np.linalg.norm(slope, axis=1)
        if len(length) and not np.abs(length - 1.0).max() <= SLOPE_TOLERANCE:  # also catches NaN
            worst = int(np.argmax(np.abs(length - 1.0)))
            raise InvalidInputError(
                f"{type(self).__name__} needs the signed distance to its surface, whose gradient has length "
                f"one, got {length[worst]:.3g} at {np.round(points[worst], 6).tolist()}: divide a level set "
                "function by the length of its gradient, or round off edges"
            )
        return np.asarray(slope / length[:, None])

    def curvatures(self, points: np.ndarray) -> np.ndarray:
        """Return central differences of the gradient."""
        columns = differences(self.normals, points)
        return 0.5 * (columns + np.swapaxes(columns, 1, 2))
