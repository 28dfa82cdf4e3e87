"""Rigid obstacles: immovable bodies given by their signed distance."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from typing import Literal, Protocol, TypeAlias, runtime_checkable

import numpy as np

from fenics_contact.errors import InvalidInputError, calling
from fenics_contact.scene.checked import checked
from fenics_contact.scene.vectors import Vector, unit_vector

#: Step of a central difference, relative to the extent of the points: the smallest one. Far from the origin
#: it is the one at which the rounding of the values is as large as what the difference leaves out.
DIFFERENCE = 1e-5
#: By how much the gradient of a distance may miss the length one.
SLOPE_TOLERANCE = 0.05


@runtime_checkable
class RigidObstacle(Protocol):
    """An immovable body; write a class with these members to add one."""

    def distance(self, points: np.ndarray) -> np.ndarray:
        """Return the signed distance, negative inside the obstacle, (n, dim) -> (n,), [length]."""

    def normals(self, points: np.ndarray) -> np.ndarray:
        """Return the gradient of the distance, which points out of the obstacle, (n, dim) -> (n, dim)."""

    def curvatures(self, points: np.ndarray) -> np.ndarray:
        """Return the second derivatives of the distance, (n, dim) -> (n, dim, dim), [1 / length]."""


Quantity: TypeAlias = Literal["distance", "normals", "curvatures"]


def asked(obstacle: RigidObstacle, what: Quantity, points: np.ndarray) -> np.ndarray:
    """Ask an obstacle, and refuse what it must not answer.

    Args:
        obstacle: The obstacle.
        what: Which of its members.
        points: Where, shape (n, dim), [length].

    Returns:
        Its answer, shape (n,), (n, dim) or (n, dim, dim).

    Raises:
        InvalidInputError: If the answer has another shape or is not finite.
        UserCodeError: If it raises.
    """
    name = f"the {what} of obstacle {type(obstacle).__name__}"
    with calling(name):
        values = np.asarray(getattr(obstacle, what)(points), dtype=np.float64)
    order = ("distance", "normals", "curvatures").index(what)
    shape = (len(points), *[points.shape[1]] * order)
    if values.shape != shape or not np.isfinite(values).all():
        given = f"shape {values.shape}" if values.shape != shape else "NaN or infinity"
        raise InvalidInputError(
            f"{name} must be finite numbers of shape {shape} for points of shape {points.shape}, got "
            f"{given}: it gets all points at once, a row each"
        )
    return values


@dataclass(frozen=True)
@checked()
class RigidPlane:
    """A half space, in the plane a half plane.

    Attributes:
        point: Any point of its surface, [length].
        normal: Direction from the obstacle into the free side; scaled to unit length.
    """

    point: Vector
    normal: Vector

    def __post_init__(self) -> None:
        """Scale the normal, refuse one without direction."""
        _require_place(self, self.point)
        direction = unit_vector("RigidPlane.normal", self.normal, len(self.point))
        object.__setattr__(self, "normal", direction)

    @property
    def dim(self) -> int:
        """Dimension of the space that it divides."""
        return len(self.point)

    def distance(self, points: np.ndarray) -> np.ndarray:
        """Return n·(x − point)."""
        return np.asarray((points - np.asarray(self.point)) @ np.asarray(self.normal))

    def normals(self, points: np.ndarray) -> np.ndarray:
        """Return n everywhere."""
        return np.tile(np.asarray(self.normal), (len(points), 1))

    def curvatures(self, points: np.ndarray) -> np.ndarray:
        """Return zeros."""
        return np.zeros((*points.shape, points.shape[1]))


class _Round:
    """Sphere and cylinder: the distance to a point or an axis less a radius, its sign turned where hollow."""

    radius: float
    hollow: bool

    def distance(self, points: np.ndarray) -> np.ndarray:
        """Return ±(‖arm‖ − radius) with the arm from centre or axis to the point."""
        return self._sign * (np.linalg.norm(self._arm(points), axis=1) - self.radius)

    def normals(self, points: np.ndarray) -> np.ndarray:
        """Return ± the direction of the arm."""
        return self._sign * self._out(points)[0]

    def curvatures(self, points: np.ndarray) -> np.ndarray:
        """Return ±(Q − n nᵀ)/‖arm‖, Q the projection that makes the arm."""
        out, length = self._out(points)
        across = self._across(points.shape[1]) - out[:, :, None] * out[:, None, :]
        return np.asarray(self._sign * across / length[:, None, None])

    @property
    def _sign(self) -> float:
        return -1.0 if self.hollow else 1.0

    def _out(self, points: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """Return direction and length of the arm."""
        arm = self._arm(points)
        length = np.maximum(np.linalg.norm(arm, axis=1), np.finfo(float).tiny)
        return arm / length[:, None], length

    def _arm(self, points: np.ndarray) -> np.ndarray:
        raise NotImplementedError

    def _across(self, dim: int) -> np.ndarray:
        return np.eye(dim)


@dataclass(frozen=True)
@checked()
class RigidSphere(_Round):
    """A ball, in the plane a disc; or everything outside it.

    Attributes:
        centre: Its centre, [length].
        radius: Its radius > 0, [length].
        hollow: Whether the obstacle is all that lies outside the radius: a socket.
    """

    centre: Vector
    radius: float
    hollow: bool = False

    def __post_init__(self) -> None:
        """Refuse a radius that is not positive."""
        _require_place(self, self.centre)
        _require_radius(self, self.radius)

    @property
    def dim(self) -> int:
        """Dimension of the space that it lies in."""
        return len(self.centre)

    def _arm(self, points: np.ndarray) -> np.ndarray:
        return np.asarray(points - np.asarray(self.centre))


@dataclass(frozen=True)
@checked()
class RigidCylinder(_Round):
    """An endless round bar in space; or everything outside it.

    Attributes:
        point: Any point of its axis, [length].
        axis: Direction of the axis; scaled to unit length.
        radius: Its radius > 0, [length].
        hollow: Whether the obstacle is all that lies outside the radius: a hole.
    """

    point: Vector
    axis: Vector
    radius: float
    hollow: bool = False

    def __post_init__(self) -> None:
        """Scale the axis, refuse a radius that is not positive."""
        object.__setattr__(self, "axis", unit_vector("RigidCylinder.axis", self.axis, 3))
        _require_place(self, self.point, (3,))
        _require_radius(self, self.radius)

    @property
    def dim(self) -> int:
        """Dimension of the space that it lies in, 3."""
        return 3

    def _arm(self, points: np.ndarray) -> np.ndarray:
        return np.asarray((points - np.asarray(self.point)) @ self._across(3))

    def _across(self, dim: int) -> np.ndarray:
        axis = np.asarray(self.axis)
        return np.eye(dim) - np.outer(axis, axis)


@dataclass(frozen=True)
@checked()
class DistanceObstacle:
    """An obstacle given by a function.

    Attributes:
        function: Signed distance, negative inside, (n, dim) -> (n,), [length]; smooth where bodies touch.
        gradient: Its gradient, (n, dim) -> (n, dim); central differences if it is None.
    """

    function: Callable[[np.ndarray], np.ndarray]
    gradient: Callable[[np.ndarray], np.ndarray] | None = None

    def distance(self, points: np.ndarray) -> np.ndarray:
        """Return the function's values.

        Raises:
            InvalidInputError: If they are not one finite number a point.
        """
        values = np.asarray(self.function(points), dtype=np.float64)
        if values.shape != (len(points),) or not np.isfinite(values).all():
            raise InvalidInputError(
                f"the distance of an obstacle must be one finite number a point, shape ({len(points)},), "
                f"got shape {values.shape} or NaN: write it for an array of points, (n, dim) -> (n,)"
            )
        return values

    def normals(self, points: np.ndarray) -> np.ndarray:
        """Return the gradient at unit length.

        Raises:
            InvalidInputError: If its length is not one: the function is no distance; or of another shape.
        """
        slope = _differences(self.distance, points) if self.gradient is None else self.gradient(points)
        slope = np.asarray(slope, dtype=np.float64)
        if slope.shape != points.shape:
            raise InvalidInputError(
                f"the gradient of an obstacle's distance must have shape {points.shape} like the points, got "
                f"{slope.shape}: write it for an array of points, (n, dim) -> (n, dim)"
            )
        length = np.linalg.norm(slope, axis=1)
        if len(length) and not np.abs(length - 1.0).max() <= SLOPE_TOLERANCE:  # NaN is none, either
            worst = int(np.argmax(np.abs(length - 1.0)))
            raise InvalidInputError(
                "an obstacle needs the signed distance to its surface, whose gradient has length one, got "
                f"{length[worst]:.3g} at {np.round(points[worst], 6).tolist()}: divide a level set function "
                "by the length of its gradient, or round off edges"
            )
        return np.asarray(slope / length[:, None])

    def curvatures(self, points: np.ndarray) -> np.ndarray:
        """Return central differences of the gradient."""
        columns = _differences(self.normals, points)
        return 0.5 * (columns + np.swapaxes(columns, 1, 2))


def _differences(function: Callable[[np.ndarray], np.ndarray], points: np.ndarray) -> np.ndarray:
    """Return central differences along each axis, stacked last."""
    if len(points) == 0:
        return np.zeros((*np.shape(function(points)), points.shape[1]))
    far = float(np.abs(points).max()) or 1.0
    extent = float(np.ptp(points, axis=0).max()) or far
    step = max(DIFFERENCE * extent, float(np.cbrt(np.finfo(float).eps * far * extent**2)))
    shifts = step * np.eye(points.shape[1])
    slopes = [(function(points + shift) - function(points - shift)) / (2 * step) for shift in shifts]
    return np.stack(slopes, axis=-1)


def _require_place(obstacle: object, point: Vector, dims: tuple[int, ...] = (2, 3)) -> None:
    if len(point) not in dims or not np.all(np.isfinite(point)):
        needed = " or ".join(str(dim) for dim in dims)
        raise InvalidInputError(
            f"{type(obstacle).__name__} must be placed by {needed} finite numbers, got {point!r}: give the "
            "coordinates of a point"
        )


def _require_radius(obstacle: object, radius: float) -> None:
    if not (np.isfinite(radius) and radius > 0):
        raise InvalidInputError(
            f"{type(obstacle).__name__}.radius must be a positive number, got {radius!r}: for a socket or a "
            "hole give the positive radius and hollow=True"
        )
