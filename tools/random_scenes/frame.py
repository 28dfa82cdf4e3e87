"""Where a scene lies and in what units it is written: the same recipe gives the same scene in any of them."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from fenics_contact import BodyMesh


@dataclass(frozen=True)
class Frame:
    """Points x lie at length · (R x + shift).

    Attributes:
        turn: Rotation matrix R, shape (dim, dim).
        shift: Shape (dim,).
        length: What a length of one becomes.
        force: What a force of one becomes; in the plane forces are per unit of thickness.
    """

    turn: np.ndarray
    shift: np.ndarray
    length: float = 1.0
    force: float = 1.0

    @classmethod
    def plain(cls, dim: int) -> Frame:
        """Return the frame in which scenes are built."""
        return cls(np.eye(dim), np.zeros(dim))

    @property
    def stress_unit(self) -> float:
        """What a stress of one becomes."""
        return float(self.force / self.length ** (len(self.shift) - 1))

    def mesh(self, mesh: BodyMesh) -> BodyMesh:
        """Return a mesh in its place."""
        return mesh.moved(np.asarray([self.point(point) for point in mesh.points]))

    def point(self, point: Sequence[float]) -> tuple[float, ...]:
        """Return the place of a point."""
        return tuple(map(float, self.length * (self.turn @ np.asarray(point) + self.shift)))

    def along(self, direction: Sequence[float], size: float = 1.0) -> tuple[float, ...]:
        """Return a direction, or with a size a vector."""
        return tuple(map(float, size * self.turn @ np.asarray(direction)))

    def way(self, displacement: Sequence[float | None]) -> tuple[float | None, ...]:
        """Return a displacement, of which components may be open where the frame is turned by quarters."""
        if None not in displacement:
            return self.along(displacement, self.length)  # type: ignore[arg-type]
        axes = np.abs(self.turn).argmax(axis=1)
        return tuple(
            None
            if displacement[axis] is None
            else float(self.length * self.turn[row, axis] * displacement[axis])  # type: ignore[operator]
            for row, axis in enumerate(axes)
        )

    def back(self, vectors: np.ndarray, unit: float) -> np.ndarray:
        """Return vectors of this frame, shape (n, dim), as they are in the plain one."""
        return np.asarray(vectors @ self.turn / unit)
