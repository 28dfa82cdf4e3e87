"""Surfaces of revolution: a profile in a half plane rotated about an axis."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from fenics_contact.checks import GivenVector, checked, unit_vector
from fenics_contact.display import displayed
from fenics_contact.surface_shapes.places import outer, require_place, require_plane
from fenics_contact.surface_shapes.protocol import SurfaceShape

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
        >>> from fenics_contact.surface_shapes.plane import Plane
        >>> from fenics_contact.surface_shapes.revolved import Revolved
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
