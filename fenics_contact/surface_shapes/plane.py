"""A plane surface."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from fenics_contact.checks import GivenVector, checked, unit_vector
from fenics_contact.surface_shapes.places import require_place


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
