"""Planes, spheres, cylinders, tori, prisms and surfaces of revolution by their signed distances."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from functools import cached_property
from typing import Literal, Protocol, TypeAlias, runtime_checkable

import numpy as np

from fenics_contact._base.checks import GivenVector, checked, floats, unit_vector
from fenics_contact._base.display import displayed
from fenics_contact.errors import InvalidInputError
from fenics_contact.errors.kinds import user_code


@runtime_checkable
class SurfaceShape(Protocol):
    """The true surface of a body, given by its signed distance; write a class with these members to add one.

    A class for only one dimension declares it by an attribute ``dim``.
    """

    def distance(self, points: np.ndarray) -> np.ndarray:
        """Return the signed distance, negative inside the body, (n, dim) -> (n,), [length]."""

    def normals(self, points: np.ndarray) -> np.ndarray:
        """Return the gradient of the distance, which points out of the body, (n, dim) -> (n, dim)."""

    def curvatures(self, points: np.ndarray) -> np.ndarray:
        """Return the second derivatives of the distance, (n, dim) -> (n, dim, dim), [1 / length]."""


Quantity: TypeAlias = Literal["distance", "normals", "curvatures"]


def evaluate_shape(shape: SurfaceShape, what: Quantity, points: np.ndarray) -> np.ndarray:
    """Evaluate a member of a shape or rigid obstacle, and check the result."""
    name = f"the {what} of {type(shape).__name__}"
    with user_code(name):
        values = np.asarray(getattr(shape, what)(points), dtype=np.float64)
    order = ("distance", "normals", "curvatures").index(what)
    needed = (len(points), *[points.shape[1]] * order)
    if values.shape != needed or not np.isfinite(values).all():
        given = f"shape {values.shape}" if values.shape != needed else "NaN or infinity"
        raise InvalidInputError(
            f"{name} must be finite numbers of shape {needed}, got {given}: it receives all points at once"
        )
    return values


#: Largest number of steps onto a surface: one if the distance is exact, a few if it is nearly exact.
STEPS = 8
#: Points this close to the surface, relative to their coordinates, lie on it.
ROUNDING = 16 * float(np.finfo(float).eps)


def closest_points(shape: SurfaceShape, points: np.ndarray) -> np.ndarray:
    """Return the points of a surface that are closest to given ones; any of several.

    x − d(x) n(x), repeated if the distance is not exact, until the points lie on the surface or do not come
    closer.
    """
    closest = np.array(points, dtype=np.float64)
    before = np.inf
    for _ in range(STEPS):
        distance = evaluate_shape(shape, "distance", closest)
        far = float(np.abs(distance).max(initial=0.0))
        if far <= ROUNDING * np.abs(closest).max(initial=0.0) or far > 0.5 * before:
            break
        closest, before = closest - distance[:, None] * evaluate_shape(shape, "normals", closest), far
    return closest


def tangent_bases(normals: np.ndarray) -> np.ndarray:
    """Return an orthonormal basis of the plane normal to each unit normal, (n, dim) -> (n, dim − 1, dim).

    The reflection that maps ∓e_dim to the normal maps the other axes to it.
    """
    dim = normals.shape[1]
    mirror = normals + np.where(normals[:, -1:] >= 0, 1.0, -1.0) * np.eye(dim)[-1]
    length = np.einsum("nd,nd->n", mirror, mirror)[:, None, None]
    reflection = np.eye(dim) - 2 * mirror[:, :, None] * mirror[:, None, :] / length
    return np.asarray(reflection[:, :-1, :])


#: Step of a central difference, relative to the extent of the points: the smallest one. Far from the origin
#: it balances the rounding of the values and the truncation error.
DIFFERENCE = 1e-5


def differences(function: Callable[[np.ndarray], np.ndarray], points: np.ndarray) -> np.ndarray:
    """Return central differences along each axis, stacked last."""
    if len(points) == 0:
        return np.zeros((*np.shape(function(points)), points.shape[1]))
    far = float(np.abs(points).max()) or 1.0
    extent = float(np.ptp(points, axis=0).max()) or far
    step = max(DIFFERENCE * extent, float(np.cbrt(np.finfo(float).eps * far * extent**2)))
    shifts = step * np.eye(points.shape[1])
    slopes = [(function(points + shift) - function(points - shift)) / (2 * step) for shift in shifts]
    return np.stack(slopes, axis=-1)


def require_place(shape: object, point: GivenVector, dims: tuple[int, ...] = (2, 3)) -> None:
    """Reject a point without ``dim`` finite coordinates."""
    if len(point) not in dims or not np.all(np.isfinite(point)):
        needed = " or ".join(str(dim) for dim in dims)
        raise InvalidInputError(
            f"{type(shape).__name__} must be placed by {needed} finite numbers, got {point!r}"
        )


def require_radius(shape: object, radius: float, name: str = "radius") -> None:
    """Reject a radius that is not positive."""
    if not (np.isfinite(radius) and radius > 0):
        raise InvalidInputError(
            f"{type(shape).__name__}.{name} must be positive, got {radius!r}: for a hole add hollow=True"
        )


def outer(first: np.ndarray, second: np.ndarray) -> np.ndarray:
    """Return products a bᵀ of vectors in rows, (n, dim) -> (n, dim, dim)."""
    return np.asarray(first[:, :, None] * second[:, None, :])


def require_plane(shape: object, profile: object) -> None:
    """Reject a profile that is a shape in space."""
    if getattr(profile, "dim", 2) != 2:
        raise InvalidInputError(
            f"{type(shape).__name__}.profile must be a plane shape, got {type(profile).__name__} in space"
        )


@displayed
@dataclass(frozen=True)
@checked()
class Extruded:
    """An infinite prism: a profile extruded along an axis.

    A point x has the coordinates ((x − point)·across, (x − point)·(axis × across)) in the profile's plane, so
    that across, axis × across and axis are right-handed: with the axis z and across x they are x and y.

    Attributes:
        profile: A shape in the plane.
        point: Origin of the profile's plane, [length].
        axis: Direction of extrusion; scaled to unit length.
        across: Direction of the profile's first coordinate; made perpendicular to the axis, scaled.

    Example:
        >>> import numpy as np
        >>> from fenics_contact.shapes import Extruded
        >>> from fenics_contact.shapes import Sphere
        >>> wire = Extruded(Sphere((2.0, 0.0), 0.5), (0, 0, 0), axis=(0, 1, 0), across=(1, 0, 0))
        >>> wire.distance(np.array([[3.0, 7.0, 0.0]]))
        array([0.5])
    """

    profile: SurfaceShape
    point: GivenVector
    axis: GivenVector
    across: GivenVector

    def __post_init__(self) -> None:
        """Make the directions perpendicular; reject parallel ones and a profile that is not in the plane."""
        name = type(self).__name__
        require_plane(self, self.profile)
        require_place(self, self.point, (3,))
        axis = np.asarray(unit_vector(f"{name}.axis", self.axis, 3))
        across = np.asarray(unit_vector(f"{name}.across", self.across, 3))
        across = across - (across @ axis) * axis
        if np.linalg.norm(across) < 1e-6:
            raise InvalidInputError(
                f"{name}.across must not be parallel to the axis {self.axis!r}, got {self.across!r}: turn it"
            )
        object.__setattr__(self, "axis", floats(axis))
        object.__setattr__(self, "across", unit_vector(f"{name}.across", floats(across), 3))

    @property
    def dim(self) -> int:
        """Dimension of the space that it lies in, 3."""
        return 3

    def distance(self, points: np.ndarray) -> np.ndarray:
        """Return the profile's distance."""
        return self.profile.distance(self._flat(points))

    def normals(self, points: np.ndarray) -> np.ndarray:
        """Return the profile's normals in space."""
        return np.asarray(self.profile.normals(self._flat(points)) @ self._plane)

    def curvatures(self, points: np.ndarray) -> np.ndarray:
        """Return the profile's curvatures in space; zero along the axis."""
        return np.asarray(self._plane.T @ self.profile.curvatures(self._flat(points)) @ self._plane)

    @property
    def _plane(self) -> np.ndarray:
        """Directions of the profile's coordinates, (2, 3)."""
        return np.stack([self.across, np.cross(self.axis, self.across)])

    def _flat(self, points: np.ndarray) -> np.ndarray:
        return np.asarray((points - np.asarray(self.point)) @ self._plane.T)


@dataclass(frozen=True)
@checked()
class Plane:
    """A half space, in the plane a half plane.

    Attributes:
        point: Any point of its surface, [length].
        normal: Outward direction from the body; scaled to unit length.
    """

    point: GivenVector
    normal: GivenVector

    def __post_init__(self) -> None:
        """Scale the normal; reject a zero one."""
        require_place(self, self.point)
        direction = unit_vector(f"{type(self).__name__}.normal", self.normal, len(self.point))
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


#: If the slope across the axis agrees with the curvature there to this tolerance, the surface is smooth at
#: the axis, and its curvature around the axis is that along the profile, which avoids 0 / 0.
SMOOTH = 1e-10


@displayed
@dataclass(frozen=True)
@checked()
class Revolved:
    """The body of revolution of a profile about an axis.

    A point x has the coordinates (r, z) in the profile's plane: its distance from the axis, and
    z = (x − point)·axis. The profile is evaluated only for r >= 0.

    Attributes:
        profile: A shape in the plane; it should cross the axis at a right angle.
        point: Point of the axis with z = 0, [length].
        axis: Direction of the axis; scaled to unit length.

    Example:
        >>> import numpy as np
        >>> from fenics_contact.shapes import Plane
        >>> from fenics_contact.shapes import Revolved
        >>> cone = Revolved(Plane((0.0, 1.0), (1.0, 1.0)), point=(0, 0, 0), axis=(0, 0, 1))
        >>> cone.distance(np.array([[0.6, 0.8, 1.0]])).round(6)
        array([0.707107])
    """

    profile: SurfaceShape
    point: GivenVector
    axis: GivenVector

    def __post_init__(self) -> None:
        """Scale the axis; reject a profile that is not in the plane."""
        require_plane(self, self.profile)
        require_place(self, self.point, (3,))
        object.__setattr__(self, "axis", unit_vector(f"{type(self).__name__}.axis", self.axis, 3))

    @property
    def dim(self) -> int:
        """Dimension of the space that it lies in, 3."""
        return 3

    def distance(self, points: np.ndarray) -> np.ndarray:
        """Return the profile's distance."""
        return self.profile.distance(self._flat(points)[0])

    def normals(self, points: np.ndarray) -> np.ndarray:
        """Return the profile's normals in space."""
        flat, out = self._flat(points)
        slope = self.profile.normals(flat)
        return np.asarray(slope[:, :1] * out + slope[:, 1:] * np.asarray(self.axis))

    def curvatures(self, points: np.ndarray) -> np.ndarray:
        """Return the profile's curvatures in space, with its slope over the radius around the axis."""
        flat, out = self._flat(points)
        slope, bend = self.profile.normals(flat)[:, 0], self.profile.curvatures(flat)
        plane = np.stack([out, np.broadcast_to(self.axis, out.shape)], axis=1)
        # The distance of the axis from the surface is the length scale for points close to the axis.
        radius = np.maximum(flat[:, 0], np.finfo(float).eps * np.abs(self.profile.distance(flat)))
        smooth = np.abs(slope - flat[:, 0] * bend[:, 0, 0]) <= SMOOTH
        around = np.where(smooth, bend[:, 0, 0], slope / np.maximum(radius, np.finfo(float).tiny))
        turning = np.cross(self.axis, out)
        in_plane = np.swapaxes(plane, 1, 2) @ bend @ plane
        return np.asarray(in_plane + around[:, None, None] * outer(turning, turning))

    def _flat(self, points: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """Return the coordinates (r, z), (n, 2), and the directions away from the axis, any on it, (n, 3)."""
        axis = np.asarray(self.axis)
        arm = points - np.asarray(self.point)
        along = arm @ axis
        arm = arm - along[:, None] * axis
        radius = np.linalg.norm(arm, axis=1)
        any_way = np.cross(axis, np.eye(3)[np.argmin(np.abs(axis))])
        arm[radius == 0] = any_way / np.linalg.norm(any_way)
        out = arm - (arm @ axis)[:, None] * axis  # removes rounding along the axis
        out /= np.linalg.norm(out, axis=1)[:, None]
        return np.stack([radius, along], axis=1), out


class _Round:
    """The distance to a point or an axis less a radius, with the opposite sign if hollow."""

    radius: float
    hollow: bool

    def distance(self, points: np.ndarray) -> np.ndarray:
        """Return ±(‖arm‖ − radius) with the arm from centre or axis to the point."""
        return self._sign * (np.linalg.norm(self._arm(points), axis=1) - self.radius)

    def normals(self, points: np.ndarray) -> np.ndarray:
        """Return ± the direction of the arm; arbitrary at the centre."""
        return self._sign * self._out(points)[0]

    def curvatures(self, points: np.ndarray) -> np.ndarray:
        """Return ±(Q − n nᵀ)/‖arm‖, Q the projection that makes the arm."""
        out, length = self._out(points)
        return np.asarray(
            self._sign * (self._across(points.shape[1]) - outer(out, out)) / length[:, None, None]
        )

    @property
    def _sign(self) -> float:
        return -1.0 if self.hollow else 1.0

    def _out(
        self, points: np.ndarray, shortest: float = float(np.finfo(float).eps)
    ) -> tuple[np.ndarray, np.ndarray]:
        """Return direction and length of the arm.

        `shortest`: smallest length of arms relative to the radius: at the centre all directions are normal.
        """
        arm = self._arm(points)
        length = np.linalg.norm(arm, axis=1)
        # The column that the projection shortens least is a possible direction of the arm.
        across = self._across(points.shape[1])
        any_way = across[np.argmax(np.diag(across))]
        arm[length == 0] = any_way
        direction = arm / np.where(length == 0, np.linalg.norm(any_way), length)[:, None]
        return direction, np.maximum(length, shortest * self.radius)

    def _arm(self, points: np.ndarray) -> np.ndarray:
        raise NotImplementedError

    def _across(self, dim: int) -> np.ndarray:
        return np.eye(dim)


@dataclass(frozen=True)
@checked()
class Sphere(_Round):
    """A ball, in the plane a disc; or everything outside it.

    Attributes:
        centre: Its centre, [length].
        radius: Its radius > 0, [length].
        hollow: Whether the body is everything outside the radius: a socket.
    """

    centre: GivenVector
    radius: float
    hollow: bool = False

    def __post_init__(self) -> None:
        """Reject a radius that is not positive."""
        require_place(self, self.centre)
        require_radius(self, self.radius)

    @property
    def dim(self) -> int:
        """Dimension of the space that it lies in."""
        return len(self.centre)

    def _arm(self, points: np.ndarray) -> np.ndarray:
        return np.asarray(points - np.asarray(self.centre))


class Circle(Sphere):
    """A disc in the plane, or everything outside it; arguments as for `Sphere`."""

    def __post_init__(self) -> None:
        """Reject a centre that is not in the plane."""
        require_place(self, self.centre, (2,))
        super().__post_init__()


@dataclass(frozen=True)
@checked()
class Cylinder(_Round):
    """An infinite round bar in space; or everything outside it.

    Attributes:
        point: Any point of its axis, [length].
        axis: Direction of the axis; scaled to unit length.
        radius: Its radius > 0, [length].
        hollow: Whether the body is everything outside the radius: a hole.
    """

    point: GivenVector
    axis: GivenVector
    radius: float
    hollow: bool = False

    def __post_init__(self) -> None:
        """Scale the axis; reject a radius that is not positive."""
        object.__setattr__(self, "axis", unit_vector(f"{type(self).__name__}.axis", self.axis, 3))
        require_place(self, self.point, (3,))
        require_radius(self, self.radius)

    @property
    def dim(self) -> int:
        """Dimension of the space that it lies in, 3."""
        return 3

    def _arm(self, points: np.ndarray) -> np.ndarray:
        return np.asarray((points - np.asarray(self.point)) @ self._across(3))

    def _across(self, dim: int) -> np.ndarray:
        axis = np.asarray(self.axis)
        return np.eye(dim) - np.outer(axis, axis)


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
                f"({len(points)},), got shape {values.shape} or NaN: write it for an array of points"
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
                f"the gradient of {type(self).__name__} must have shape {points.shape}, got {slope.shape}"
            )
        length = np.linalg.norm(slope, axis=1)
        if len(length) and not np.abs(length - 1.0).max() <= SLOPE_TOLERANCE:  # also catches NaN
            worst = int(np.argmax(np.abs(length - 1.0)))
            raise InvalidInputError(
                f"{type(self).__name__} needs the signed distance, with a gradient of length one, got "
                f"{length[worst]:.3g} at {np.round(points[worst], 6)}: divide by that, or round edges"
            )
        return np.asarray(slope / length[:, None])

    def curvatures(self, points: np.ndarray) -> np.ndarray:
        """Return central differences of the gradient."""
        columns = differences(self.normals, points)
        return 0.5 * (columns + np.swapaxes(columns, 1, 2))


class AboutAxis:
    """Distance, normals and curvatures of a shape in space that is the revolution of a profile."""

    @property
    def dim(self) -> int:
        """Dimension of the space that it lies in, 3."""
        return 3

    def distance(self, points: np.ndarray) -> np.ndarray:
        """Return the signed distance, negative inside the body."""
        return self._revolved.distance(points)

    def normals(self, points: np.ndarray) -> np.ndarray:
        """Return the gradient of the distance."""
        return self._revolved.normals(points)

    def curvatures(self, points: np.ndarray) -> np.ndarray:
        """Return those of the profile, and around the axis those of its circles."""
        return self._revolved.curvatures(points)

    @property
    def _revolved(self) -> Revolved:
        raise NotImplementedError


@dataclass(frozen=True)
@checked()
class Torus(AboutAxis):
    """A ring of round wire; or everything outside it.

    Attributes:
        centre: Its centre, [length].
        axis: Direction about which it is round; scaled to unit length.
        ring_radius: Radius of the circle that the middle of the wire forms, [length].
        tube_radius: Radius of the wire, above zero and below the ring's, [length].
        hollow: Whether the body is everything outside the wire: a groove.
    """

    centre: GivenVector
    axis: GivenVector
    ring_radius: float
    tube_radius: float
    hollow: bool = False

    def __post_init__(self) -> None:
        """Scale the axis; reject radii that do not form a ring."""
        object.__setattr__(self, "axis", unit_vector(f"{type(self).__name__}.axis", self.axis, 3))
        require_place(self, self.centre, (3,))
        require_radius(self, self.tube_radius, "tube_radius")
        if not (np.isfinite(self.ring_radius) and self.tube_radius < self.ring_radius):
            raise InvalidInputError(f"ring_radius must exceed tube_radius, got {self.ring_radius!r}")

    @cached_property
    def _revolved(self) -> Revolved:
        wire = Sphere((self.ring_radius, 0.0), self.tube_radius, self.hollow)
        return Revolved(wire, self.centre, self.axis)
