"""Tori, such as the crowns of rings and links."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property

import numpy as np

from fenics_contact.checks import GivenVector, checked, unit_vector
from fenics_contact.errors import InvalidInputError
from fenics_contact.surface_shapes.places import require_place, require_radius
from fenics_contact.surface_shapes.revolved import Revolved
from fenics_contact.surface_shapes.round import Sphere


@dataclass(frozen=True)
@checked()
class Torus:
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
            raise InvalidInputError(
                f"{type(self).__name__}.ring_radius must be a number above the tube_radius "
                f"{self.tube_radius!r}, got {self.ring_radius!r}: it is measured from the axis to the middle "
                "of the wire; for a wire without a hole use Sphere or Revolved"
            )

    @property
    def dim(self) -> int:
        """Dimension of the space that it lies in, 3."""
        return 3

    def distance(self, points: np.ndarray) -> np.ndarray:
        """Return the distance from the circle less the tube's radius, with the opposite sign if hollow."""
        return self._revolved.distance(points)

    def normals(self, points: np.ndarray) -> np.ndarray:
        """Return ± the direction from the circle."""
        return self._revolved.normals(points)

    def curvatures(self, points: np.ndarray) -> np.ndarray:
        """Return those of the tube, and around the axis those of the ring."""
        return self._revolved.curvatures(points)

    @cached_property
    def _revolved(self) -> Revolved:
        wire = Sphere((self.ring_radius, 0.0), self.tube_radius, self.hollow)
        return Revolved(wire, self.centre, self.axis)
