"""Bodies of revolution that may twist: a third component of the displacement, around the axis."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from typing import Any, ClassVar

import numpy as np

from fenics_contact._kinematics.base import ByRadius, GaussPoints
from fenics_contact._kinematics.revolution import Revolution


@dataclass(frozen=True)
class Torsion(Revolution):
    """Bodies of revolution with the displacement (u_r, u_z, u_θ), alike all around.

    The gradient in space is [[u_r,r, u_r,z, −u_θ / r], [u_z,r, u_z,z, 0], [u_θ,r, u_θ,z, u_r / r]].
    """

    name = "axisymmetric with torsion"
    in_words = ", a body of revolution that may twist"
    record: ClassVar[dict[str, bool]] = {"axisymmetric": True, "torsion": True}
    held_on_axis: ClassVar[dict[int, str]] = {0: "radial displacement", 2: "displacement around"}

    @property
    def components(self) -> int:
        """Along the radius, the axis and around it."""
        return 3

    @property
    def motions(self) -> int:
        """The translation along the axis and the turn about it."""
        return 2

    @property
    def zero_stress(self) -> tuple[str, ...]:
        """None: all components may be there."""
        return ()

    @property
    def vector_in_words(self) -> str:
        """What the value of a load must hold."""
        return "three, for r, z and the way around, as the body may twist"

    @property
    def resultant_components(self) -> int:
        """Forces around the axis balance each other, their moment is given in their place."""
        return 2

    @property
    def resultant_in_words(self) -> str:
        """What the value of a resultant force must hold."""
        return "two entries, for r and z; a torque is its moment"

    def has_moment(self, moment: Any, at: Any) -> bool:
        """Return whether it acts at no point: a moment is that about the axis."""
        return at is None

    def resultant(
        self, forces: np.ndarray, places: np.ndarray, about: np.ndarray
    ) -> tuple[np.ndarray, np.ndarray | float]:
        """Return the radial and the axial force, and the torque about the axis, (1,)."""
        return forces[:, :2].sum(axis=0), np.atleast_1d(places[:, 0] @ forces[:, 2])

    def moment_at(
        self, force: np.ndarray, moment: np.ndarray, point: np.ndarray, about: np.ndarray
    ) -> np.ndarray | float:
        """Return the moment, a torque about the axis."""
        return moment

    def arms(self, places: np.ndarray, about: np.ndarray) -> np.ndarray:
        """Return distances from the axis, (n, 1)."""
        return places[:, :1]

    def further_fields(self, places: np.ndarray) -> list[np.ndarray]:
        """Return also u_θ = 1, which has the shear −1 / r, and u_θ = z, with the shear 1 of z and −z / r."""
        around = np.eye(3)[2]
        return [*super().further_fields(places), around * np.ones((len(places), 1)), around * places[:, 1:]]

    def further_strains(self, gradients: np.ndarray, by_radius: ByRadius) -> list[np.ndarray]:
        """Return also the shear around the axis across r and z."""
        across = gradients[:, 2, 0]
        shear = [across - by_radius(across, 2), gradients[:, 2, 1]]
        return [*super().further_strains(gradients, by_radius), *shear]

    def of_unit_strains(
        self, rest: np.ndarray, further: list[np.ndarray], gauss_points: Callable[[], GaussPoints]
    ) -> list[np.ndarray]:
        """Return also the stress of unit shear across r and z."""
        hoop, turned, along = further
        weights, places = gauss_points()
        radial = (weights * places[..., 0]).sum(axis=1)
        turned = rest - (radial / weights.sum(axis=1))[:, None] * (turned - rest)
        height = ((weights * places[..., 1]).sum(axis=1) / radial)[:, None]
        return [
            *super().of_unit_strains(rest, [hoop], lambda: (weights, places)),
            turned,
            along + height * (turned - rest),
        ]

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
