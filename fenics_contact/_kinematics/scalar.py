"""One number at each node in place of a displacement, such as a temperature, in space or around an axis."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any, ClassVar

import numpy as np

from fenics_contact._kinematics.base import Kinematics
from fenics_contact._kinematics.revolution import Revolution


@dataclass(frozen=True)
class Scalar(Kinematics):
    """A scalar field: its one mode without energy is a constant."""

    name = "scalar"
    can_rotate = False

    @property
    def components(self) -> int:
        """The number itself."""
        return 1

    @property
    def motions(self) -> int:
        """A constant."""
        return 1

    def rigid_modes(self, points: np.ndarray, at: np.ndarray | None = None) -> np.ndarray:
        """Return ones, shape (n, 1, 1)."""
        return np.ones((len(points if at is None else at), 1, 1))

    def kernel(self, of_material: Any, points: np.ndarray) -> np.ndarray:
        """Return ones: constants cost no energy in any material."""
        return np.ones((len(points), 1, 1))


@dataclass(frozen=True)
class RevolvedScalar(Scalar, Revolution):
    """A scalar field alike all around an axis."""

    dim: int = 2

    name = "axisymmetric scalar"
    held_on_axis: ClassVar[dict[int, str]] = {}
    least_degree = 1

    def in_space(self, x: Any, fields: tuple[Any, ...]) -> tuple[Any, ...]:
        """Return the fields themselves."""
        return fields

    def on_cells(self, density: Any, x: Any) -> Any:
        """Return the density itself."""
        return density
