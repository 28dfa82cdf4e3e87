"""Rigid obstacles, given by the shapes of their surfaces: they are fixed, or move, or forces move them."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from typing import Any, Protocol, TypeAlias, runtime_checkable

import numpy as np

from fenics_contact._base.checks import GivenVector, checked, floats
from fenics_contact._base.display import displayed
from fenics_contact.errors import InvalidInputError
from fenics_contact.errors.kinds import user_code
from fenics_contact.shapes.combined import placed
from fenics_contact.shapes.simple import Cylinder, Plane, SignedDistance, Sphere, SurfaceShape, evaluate_shape


@runtime_checkable
class RigidObstacle(SurfaceShape, Protocol):
    """A body that does not move: any of `fenics_contact.shapes`, or a class with its members."""


class RigidPlane(Plane):
    """A half space that does not move, in the plane a half plane; arguments as for `Plane`."""


class RigidSphere(Sphere):
    """A ball that does not move, in the plane a disc; or everything outside it; arguments as for `Sphere`."""


class RigidCylinder(Cylinder):
    """An endless round bar that does not move; or everything outside it; arguments as for `Cylinder`."""


class DistanceObstacle(SignedDistance):
    """A body that does not move, given by a distance function; arguments as for `SignedDistance`."""


#: Returns rotation, shape (dim, dim) or None, and translation, shape (dim,), at a time.
Path: TypeAlias = Callable[[float], tuple[Any, Any]]


@displayed
@dataclass(frozen=True)
@checked()
class MovingObstacle:
    """A rigid obstacle that moves and turns as prescribed: at a time its points x lie at R x + c.

    Large displacements follow it through the load steps, and friction depends on its motion. Small
    displacements do not: there it must be where it is at time zero.

    Attributes:
        obstacle: The obstacle before it moves.
        path: Returns the rotation R, shape (dim, dim), or None if it does not turn, and the translation c,
            dim numbers, [length], at a time.

    Raises:
        InvalidInputError: If the obstacle moves already.

    Example:
        >>> import numpy as np
        >>> roll = RigidCylinder((0, 0, 0), (0, 1, 0), 5.0)  # mm
        >>> def rolling(time):
        ...     c, s = np.cos(time), np.sin(time)
        ...     return [[c, 0, s], [0, 1, 0], [-s, 0, c]], (5.0 * time, 0.0, 0.0)
        >>> MovingObstacle(roll, rolling).at(2.0).distance(np.array([[10.0, 0.0, 6.0]]))
        array([1.])
    """

    obstacle: RigidObstacle
    path: Path

    def __post_init__(self) -> None:
        """Reject an obstacle that moves already."""
        if isinstance(self.obstacle, MovingObstacle):
            raise InvalidInputError(
                "MovingObstacle.obstacle must not move, got one that moves: give the path of both"
            )

    @property
    def dim(self) -> int:
        """Dimension of the space in which it moves: that of the obstacle, else of its path."""
        return int(getattr(self.obstacle, "dim", 0)) or len(self.frame(0.0)[1])

    def frame(self, time: float) -> tuple[np.ndarray, np.ndarray]:
        """Return rotation, shape (dim, dim), and translation, shape (dim,), at a time.

        Raises:
            InvalidInputError: If the path returns anything else.
            UserCodeError: If it raises.
        """
        with user_code("the path of MovingObstacle"):
            rotation, translation = self.path(time)
            shift = np.asarray(translation, dtype=np.float64)
            turn = np.eye(shift.size) if rotation is None else np.asarray(rotation, dtype=np.float64)
        dim = getattr(self.obstacle, "dim", shift.size)
        fits = shift.shape == (dim,) and dim in (2, 3) and turn.shape == (dim, dim)
        fits = fits and bool(np.isfinite(shift).all())
        if not fits or not np.abs(turn @ turn.T - np.eye(dim)).max() <= 1e-9 or np.linalg.det(turn) < 0:
            raise InvalidInputError(
                f"the path of MovingObstacle must return a rotation matrix of shape ({dim}, {dim}) or None, "
                f"and {dim} finite numbers, got {rotation!r}, {translation!r} at {time:g}: of determinant one"
            )
        return turn, shift

    def at(self, time: float) -> SurfaceShape:
        """Return the obstacle where it is at a time."""
        turn, shift = self.frame(time)
        return placed(self.obstacle, turn, [float(entry) for entry in shift])

    def is_where_it_was(self, time: float) -> bool:
        """Return whether it is at a time where it is at time zero."""
        pairs = zip(self.frame(0.0), self.frame(time), strict=True)
        return all(np.array_equal(before, now) for before, now in pairs)

    def distance(self, points: np.ndarray) -> np.ndarray:
        """Return the signed distance at time zero, (n, dim) -> (n,), [length]."""
        return evaluate_shape(self.at(0.0), "distance", points)

    def normals(self, points: np.ndarray) -> np.ndarray:
        """Return the gradient of the distance at time zero, (n, dim) -> (n, dim)."""
        return evaluate_shape(self.at(0.0), "normals", points)

    def curvatures(self, points: np.ndarray) -> np.ndarray:
        """Return the second derivatives of the distance at time zero, (n, dim) -> (n, dim, dim)."""
        return evaluate_shape(self.at(0.0), "curvatures", points)


@displayed
@dataclass(frozen=True)
@checked()
class RigidTool:
    """A rigid body of any shape that is the master of contact pairs and moves as a `ToolMotion` asks.

    Without a `ToolMotion` among the supports it is at rest.

    Attributes:
        name: Its name, which no body of the scene has.
        shape: Its shape before it moves: any of `fenics_contact.shapes`, or a class with their members.
        at: The reference point p, which need not belong to it: its motion is that of p and a rotation about
            p, forces act at p, moments about p, [length].

    Raises:
        InvalidInputError: If the point is not one of the shape's space, or the shape moves by itself.

    Example:
        >>> from fenics_contact import ContactPair, RigidSphere, Surface, ToolMotion
        >>> indenter = RigidTool("indenter", RigidSphere((0, 0, 5), 5.0), at=(0, 0, 5))  # mm
        >>> pair = ContactPair(Surface("block", "z1"), indenter)
        >>> pressed = ToolMotion("indenter", (0, 0, None), (0, 0, 0), force=(0, 0, -200))  # N
    """

    name: str
    shape: RigidObstacle
    at: GivenVector

    def __post_init__(self) -> None:
        """Reject points of another space and shapes that move."""
        if isinstance(self.shape, MovingObstacle | RigidTool):
            raise InvalidInputError(
                f"the shape of tool {self.name!r} must not move, got a {type(self.shape).__name__}: give its "
                "shape at rest, and its motion by a ToolMotion"
            )
        dim = getattr(self.shape, "dim", len(self.at))
        if not self.name or len(self.at) != dim or dim not in (2, 3) or not np.isfinite(self.at).all():
            raise InvalidInputError(
                f"RigidTool needs a name and a point of {dim} finite coordinates, as its shape has, got "
                f"{self.name!r} and {self.at!r}: give the point whose motion is prescribed or loaded"
            )
        object.__setattr__(self, "at", floats(np.asarray(self.at, dtype=np.float64)))

    @property
    def dim(self) -> int:
        """Dimension of the space that it lies in."""
        return len(self.at)

    def distance(self, points: np.ndarray) -> np.ndarray:
        """Return the signed distance before it moves, (n, dim) -> (n,), [length]."""
        return evaluate_shape(self.shape, "distance", points)

    def normals(self, points: np.ndarray) -> np.ndarray:
        """Return the gradient of the distance, (n, dim) -> (n, dim)."""
        return evaluate_shape(self.shape, "normals", points)

    def curvatures(self, points: np.ndarray) -> np.ndarray:
        """Return the second derivatives of the distance, (n, dim) -> (n, dim, dim)."""
        return evaluate_shape(self.shape, "curvatures", points)
