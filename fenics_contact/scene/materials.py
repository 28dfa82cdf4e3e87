"""Physics models: what a body is made of, written in UFL."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any, Protocol, runtime_checkable

import numpy as np
import ufl

from fenics_contact.errors import InvalidInputError


@runtime_checkable
class Material(Protocol):
    """What a physics model must provide; write a class with these four members to add one.

    Numbers that may differ from body to body are returned by `parameters` and reach the forms as UFL
    constants, so that all bodies of one class share one compiled form.
    """

    @property
    def parameters(self) -> tuple[float, ...]:
        """Values of the model's constants, in the order in which the forms receive them."""

    def stress(self, u: Any, parameters: Any) -> Any:
        """Return the stress tensor (3 x 3, UFL) of the displacement ``u``."""

    def stiffness(self, u: Any, v: Any, parameters: Any) -> Any:
        """Return the integrand of the symmetric bilinear form, virtual work a volume (UFL scalar)."""

    def kernel(self, points: np.ndarray) -> np.ndarray:
        """Return the zero-energy modes at ``points``, shape (n, 3) -> (n, 3, n_modes)."""


def rigid_body_modes(points: np.ndarray) -> np.ndarray:
    """Return three translations and three rotations about the centroid of ``points``.

    Rotations are divided by the largest distance from the centroid, so that all modes have about the same
    size whatever the unit of length.

    Args:
        points: Coordinates, shape (n, 3), [length].

    Returns:
        Modes, shape (n, 3, 6), dimensionless.
    """
    arm = points - points.mean(axis=0)
    arm = arm / max(float(np.abs(arm).max()), np.finfo(float).tiny)
    modes = np.zeros((len(points), 3, 6))
    modes[:, [0, 1, 2], [0, 1, 2]] = 1.0
    for axis in range(3):
        modes[:, :, 3 + axis] = np.cross(np.eye(3)[axis], arm)
    return modes


@dataclass(frozen=True)
class IsotropicElasticity:
    """Small-strain isotropic linear elasticity, σ = λ tr(ε) I + 2 G ε.

    Attributes:
        young_modulus: E > 0, [force / length²].
        poisson_ratio: ν in (−1, 0.5), dimensionless.
    """

    young_modulus: float
    poisson_ratio: float

    def __post_init__(self) -> None:
        """Refuse constants for which the energy is not positive."""
        if not (np.isfinite(self.young_modulus) and self.young_modulus > 0):
            raise InvalidInputError(
                f"young_modulus must be a positive number, got {self.young_modulus!r}: "
                "give E in force per area, for steel 2.1e5 in N/mm²"
            )
        if not -1 < self.poisson_ratio < 0.5:
            raise InvalidInputError(
                f"poisson_ratio must lie between -1 and 0.5 (excluded), got {self.poisson_ratio!r}: "
                "use 0.3 for steel; incompressible bodies need another model"
            )

    @property
    def parameters(self) -> tuple[float, float]:
        """First Lamé parameter and shear modulus, [force / length²]."""
        E, nu = self.young_modulus, self.poisson_ratio
        return E * nu / ((1 + nu) * (1 - 2 * nu)), E / (2 * (1 + nu))

    def stress(self, u: Any, parameters: Any) -> Any:
        """Return σ(u) with ``parameters`` = (λ, G)."""
        lame, shear = parameters
        strain = ufl.sym(ufl.grad(u))
        return lame * ufl.tr(strain) * ufl.Identity(3) + 2 * shear * strain

    def stiffness(self, u: Any, v: Any, parameters: Any) -> Any:
        """Return σ(u) : ε(v)."""
        return ufl.inner(self.stress(u, parameters), ufl.sym(ufl.grad(v)))

    def kernel(self, points: np.ndarray) -> np.ndarray:
        """Return the six rigid body modes."""
        return rigid_body_modes(points)
