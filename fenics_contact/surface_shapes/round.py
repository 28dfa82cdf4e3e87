"""Round surfaces: spheres, in the plane discs, and cylinders."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from fenics_contact.checks import GivenVector, checked, unit_vector
from fenics_contact.surface_shapes.places import outer, require_place, require_radius

#: Smallest length of arms relative to the radius: at the centre all directions are normal.
SHORTEST = float(np.finfo(float).eps)


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

    def _out(self, points: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """Return direction and length of the arm."""
        arm = self._arm(points)
        length = np.linalg.norm(arm, axis=1)
        # The column that the projection shortens least is a possible direction of the arm.
        across = self._across(points.shape[1])
        any_way = across[np.argmax(np.diag(across))]
        arm[length == 0] = any_way
        direction = arm / np.where(length == 0, np.linalg.norm(any_way), length)[:, None]
        return direction, np.maximum(length, SHORTEST * self.radius)

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
