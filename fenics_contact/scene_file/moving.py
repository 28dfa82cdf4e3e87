"""Obstacles of scene files that move: their path as numbers and formulas in t."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np
from pydantic import Field
from scipy.spatial.transform import Rotation

from fenics_contact.errors import InvalidInputError
from fenics_contact.scene import MovingObstacle
from fenics_contact.scene_file.expression import Expression, at_time
from fenics_contact.scene_file.part import Part
from fenics_contact.scene_file.values import FREE, Motion, Vector


@dataclass(frozen=True)
class ObstaclePath:
    """Where an obstacle is at a time.

    Attributes:
        motion: Displacement, then rotation, in the plane three components, in space six.
        about: The point about which it turns, [length].
    """

    motion: tuple[float | Expression, ...]
    about: tuple[float, ...]

    def __call__(self, time: float) -> tuple[np.ndarray, np.ndarray]:
        """Return rotation and translation at a time."""
        point = np.array(self.about)
        now = [at_time(part, time) for part in self.motion]
        numbers = [float(part(point[None])[0]) if isinstance(part, Expression) else part for part in now]
        shift, angle = np.split(np.array(numbers), [len(point)])
        about = Rotation.from_rotvec(angle if len(point) == 3 else (0.0, 0.0, angle[0]))
        turn = about.as_matrix()[: len(point), : len(point)]
        return turn, point - turn @ point + shift


class ObstaclePart(Part):
    """A rigid obstacle, which may move."""

    motion: Motion | None = Field(
        None,
        description="displacement along x, y and z, [length], then rotation about them, in radians (in the "
        "plane along x and y, then one rotation): numbers or formulas in t in quotes; large displacements "
        "follow it through the load steps",
    )
    about: Vector | None = Field(None, description="point about which it turns, the origin by default")

    def made(self, **other: Any) -> Any:
        """Build the obstacle, one that moves if there is a motion."""
        still = super().made(**other)
        if self.motion is None:
            return still
        dim = 2 if len(self.motion) == 3 else 3
        about = self.about or (0.0,) * dim
        if FREE in self.motion or None in self.motion or len(about) != dim:
            raise InvalidInputError(
                f"the motion of an obstacle must be {3 * dim - 3} numbers or formulas in t, about a point of "
                f"{dim} coordinates, got {self.motion!r} about {about!r}: prescribe all of it"
            )
        return MovingObstacle(still, ObstaclePath(self.motion, tuple(about)))
