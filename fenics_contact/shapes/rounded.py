"""Cones and boxes with rounded tips, edges and corners, by their signed distances."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property

import numpy as np
from scipy.spatial.transform import Rotation

from fenics_contact._base.checks import GivenVector, checked, floats, unit_vector
from fenics_contact._base.display import displayed
from fenics_contact.errors import InvalidInputError
from fenics_contact.shapes.simple import AboutAxis, Revolved, outer, require_place


@dataclass(frozen=True)
class _Wedge:
    """The half of a wedge in the plane (r, z), r ≥ 0, that opens along z, offset by a radius.

    `slope`: sine and cosine of the half angle.
    """

    slope: tuple[float, float]
    radius: float

    @property
    def dim(self) -> int:
        """Dimension of the space that it lies in, 2."""
        return 2

    def _parts(self, points: np.ndarray) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
        """Return the distances from the flank, those from the tip, and whether the tip is nearest."""
        sine, cosine = self.slope
        flank = points @ np.array([cosine, -sine])
        return flank, np.linalg.norm(points, axis=1), points @ np.array([sine, cosine]) < 0

    def distance(self, points: np.ndarray) -> np.ndarray:
        """Return the signed distance, (n, 2) -> (n,)."""
        flank, tip, near = self._parts(points)
        return np.where(near, tip, flank) - self.radius

    def normals(self, points: np.ndarray) -> np.ndarray:
        """Return its gradient, (n, 2) -> (n, 2)."""
        _, tip, near = self._parts(points)
        sine, cosine = self.slope
        away = points / np.maximum(tip, np.finfo(float).tiny)[:, None]
        return np.where(near[:, None], away, np.array([cosine, -sine]))

    def curvatures(self, points: np.ndarray) -> np.ndarray:
        """Return its second derivatives, (n, 2) -> (n, 2, 2)."""
        _, tip, near = self._parts(points)
        normal = self.normals(points)
        round_tip = (np.eye(2) - outer(normal, normal)) / np.maximum(tip, np.finfo(float).tiny)[:, None, None]
        return np.where(near[:, None, None], round_tip, 0.0)


@displayed
@dataclass(frozen=True)
@checked()
class Cone(AboutAxis):
    """An endless cone that opens along its axis, with a round tip.

    Attributes:
        tip: Its outermost point, [length].
        axis: Direction from the tip into the cone; scaled to unit length.
        half_angle: Angle between axis and flank, above 0 and below π/2, in radians.
        radius: Radius of the ball that is the tip, tangent to the flank, [length]; zero is a sharp tip, whose
            normal is not unique.

    Raises:
        InvalidInputError: If angle or radius lie outside these ranges.

    Example:
        >>> import numpy as np
        >>> from fenics_contact.shapes import Cone
        >>> rockwell = Cone((0, 0, 0), (0, 0, 1), half_angle=np.pi / 3, radius=0.2)  # mm
        >>> rockwell.distance(np.array([[0.0, 0.0, -1.0], [3.0, 0.0, 0.0]])).round(6)
        array([1.      , 1.473205])
    """

    tip: GivenVector
    axis: GivenVector
    half_angle: float
    radius: float = 0.0

    def __post_init__(self) -> None:
        """Scale the axis; reject angles and radii that no cone has."""
        require_place(self, self.tip, (3,))
        object.__setattr__(self, "axis", unit_vector(f"{type(self).__name__}.axis", self.axis, 3))
        if not 0.0 < self.half_angle < 0.5 * np.pi:
            raise InvalidInputError(f"half_angle must be from 0 to π/2 in radians, got {self.half_angle!r}")
        _require_not_negative(self, self.radius)

    @cached_property
    def _revolved(self) -> Revolved:
        slope = float(np.sin(self.half_angle)), float(np.cos(self.half_angle))
        sharp = np.asarray(self.tip) + self.radius * np.asarray(self.axis)
        return Revolved(_Wedge(slope, self.radius), floats(sharp), self.axis)


@displayed
@dataclass(frozen=True)
@checked()
class Box:
    """A box with round edges and corners, in the plane a rectangle with round corners.

    Attributes:
        centre: Its centre, [length].
        size: Its lengths along its own axes, [length].
        radius: Radius of its edges and corners, at most half of its smallest length, [length]; zero is a
            sharp edge, whose normal is not unique.
        rotation: Rotation from x, y, z to its axes: the direction of its vector is the axis, its length the
            angle; in the plane one angle, positive from x to y; in radians. None: its axes are x, y, z.

    Raises:
        InvalidInputError: If a length is not positive or the radius too large.

    Example:
        >>> import numpy as np
        >>> from fenics_contact.shapes import Box
        >>> punch = Box((0, 0, 5), (4, 4, 10), radius=0.5)  # mm
        >>> punch.distance(np.array([[0.0, 0.0, -1.0], [3.0, 3.0, 5.0]])).round(6)
        array([1.     , 1.62132])
    """

    centre: GivenVector
    size: GivenVector
    radius: float = 0.0
    rotation: GivenVector | float | None = None

    def __post_init__(self) -> None:
        """Reject lengths, radii and rotations that no box has."""
        name = type(self).__name__
        require_place(self, self.centre)
        fits = len(self.size) == self.dim and np.isfinite(self.size).all() and min(self.size) > 0
        if not fits:
            raise InvalidInputError(f"{name}.size must be {self.dim} positive numbers, got {self.size!r}")
        _require_not_negative(self, self.radius)
        if self.radius > 0.5 * min(self.size):
            raise InvalidInputError(
                f"{name}.radius must be at most {0.5 * min(self.size):g}, half the size, got {self.radius!r}"
            )
        turns = () if self.dim == 2 else (3,)
        if self.rotation is not None and (
            np.shape(self.rotation) != turns or not np.isfinite(self.rotation).all()
        ):
            needed = "one finite number" if self.dim == 2 else "three finite numbers"
            raise InvalidInputError(
                f"{name}.rotation must be {needed}, in radians, got {self.rotation!r}: give it, or None"
            )

    @property
    def dim(self) -> int:
        """Dimension of the space that it lies in."""
        return len(self.centre)

    def distance(self, points: np.ndarray) -> np.ndarray:
        """Return the distance from its nearest face, edge or corner."""
        over = self._over(points)[0]
        beyond = np.linalg.norm(np.maximum(over, 0.0), axis=1)
        return np.asarray(beyond + np.minimum(over.max(axis=1), 0.0) - self.radius)

    def normals(self, points: np.ndarray) -> np.ndarray:
        """Return the gradient of the distance."""
        return self._slopes(points)[0] @ self.directions.T

    def curvatures(self, points: np.ndarray) -> np.ndarray:
        """Return those of its round edges and corners, zero at its faces."""
        normal, outside, length = self._slopes(points)
        flat = np.eye(self.dim) * outside[:, None, :] - outer(normal, normal)
        own = (
            np.where((length > 0)[:, None, None], flat, 0.0)
            / np.where(length > 0, length, 1.0)[:, None, None]
        )
        return np.asarray(self.directions @ own @ self.directions.T)

    @cached_property
    def directions(self) -> np.ndarray:
        """Directions of its axes as columns, shape (dim, dim)."""
        angle = np.zeros(3)
        if self.rotation is not None:
            angle[3 - np.size(self.rotation) :] = self.rotation
        return np.asarray(Rotation.from_rotvec(angle).as_matrix()[: self.dim, : self.dim])

    def _over(self, points: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """Return how far points are beyond the sides of the box less its radius, and their own sides."""
        arm = (points - np.asarray(self.centre)) @ self.directions
        return np.abs(arm) - (0.5 * np.asarray(self.size) - self.radius), np.where(arm < 0, -1.0, 1.0)

    def _slopes(self, points: np.ndarray) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
        """Return own normals, along which axes points are outside, and distances from the box less radius."""
        over, side = self._over(points)
        outside = over > 0
        length = np.linalg.norm(np.where(outside, over, 0.0), axis=1)
        inner = np.eye(self.dim)[np.argmax(over, axis=1)]
        away = np.where(outside, over, 0.0) / np.where(length > 0, length, 1.0)[:, None]
        return side * np.where((length > 0)[:, None], away, inner), outside, length


def _require_not_negative(shape: object, radius: float) -> None:
    if not (np.isfinite(radius) and radius >= 0):
        raise InvalidInputError(f"{type(shape).__name__}.radius must be at least 0, got {radius!r}")
