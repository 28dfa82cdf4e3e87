"""Prisms: a profile in the plane extruded along an axis."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from fenics_contact.checks import GivenVector, checked, floats, unit_vector
from fenics_contact.display import displayed
from fenics_contact.errors import InvalidInputError
from fenics_contact.surface_shapes.places import require_place, require_plane
from fenics_contact.surface_shapes.protocol import SurfaceShape


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
        >>> from fenics_contact.surface_shapes.extruded import Extruded
        >>> from fenics_contact.surface_shapes.round import Sphere
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
                f"{name}.across must not be parallel to the axis, got {self.across!r} and {self.axis!r}: "
                "give the direction of the profile's first coordinate"
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
