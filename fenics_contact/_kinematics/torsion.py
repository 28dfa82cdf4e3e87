"""Bodies of revolution that may twist: a third component of the displacement, around the axis."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np

from fenics_contact._kinematics.revolution import Revolution


@dataclass(frozen=True)
class Torsion(Revolution):
    """Bodies of revolution with the displacement (u_r, u_z, u_θ), alike all around.

    The gradient in space is [[u_r,r, u_r,z, −u_θ / r], [u_z,r, u_z,z, 0], [u_θ,r, u_θ,z, u_r / r]].
    """

    name = "axisymmetric with torsion"

    @property
    def components(self) -> int:
        """Along the radius, the axis and around it."""
        return 3

    @property
    def motions(self) -> int:
        """The translation along the axis and the turn about it."""
        return 2

    def in_section(self, vector: Any) -> Any:
        """Return the components along the radius and the axis (UFL)."""
        import ufl

        return ufl.as_vector([vector[0], vector[1]])

    def _turn(self, u: Any) -> Any:
        return u[2]

    def _gradient_in_space(self, gradient: Any, hoop: Any, turn: Any) -> Any:
        import ufl

        return ufl.as_tensor(
            [
                [gradient[0, 0], gradient[0, 1], -turn],
                [gradient[1, 0], gradient[1, 1], 0],
                [gradient[2, 0], gradient[2, 1], hoop],
            ]
        )

    def _modes(self, points: np.ndarray, radius: float) -> np.ndarray:
        """Return the translation and the turn u_θ = r / R, of about the same size, shape (n, 3, 2)."""
        modes = super()._modes(points, radius)
        modes[:, 2, 1] = points[:, 0] / max(radius, np.finfo(float).tiny)
        return modes
