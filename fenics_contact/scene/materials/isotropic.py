"""Isotropic elasticity: the common base of all isotropic models, and the model in space."""

from __future__ import annotations

from dataclasses import dataclass

import ufl
from ufl.core.expr import Expr

from fenics_contact.checks import checked
from fenics_contact.scene.materials.constants import check_isotropic, lame
from fenics_contact.scene.materials.elasticity import Elasticity, strain


@dataclass(frozen=True)
@checked()
class Isotropic(Elasticity):
    """The constants that all isotropic models have."""

    young_modulus: float
    poisson_ratio: float
    thermal_expansion: float | None = None

    def __post_init__(self) -> None:
        """Reject constants for which the strain energy is not positive."""
        check_isotropic(self.young_modulus, self.poisson_ratio, self.thermal_expansion)

    @property
    def expands(self) -> bool:
        """Whether α was given."""
        return self.thermal_expansion is not None

    @property
    def expansion(self) -> tuple[float, ...]:
        """α where it was given, else nothing: the last of the parameters."""
        return () if self.thermal_expansion is None else (self.thermal_expansion,)


@dataclass(frozen=True)
class IsotropicElasticity(Isotropic):
    """Small-strain isotropic linear elasticity in space, σ = λ tr(ε) I + 2 G ε − ΔT (3λ + 2G) α I.

    Attributes:
        young_modulus: Young's modulus E > 0, [force / length²].
        poisson_ratio: Poisson's ratio ν in (−1, 0.5), dimensionless.
        thermal_expansion: Thermal expansion α, strain per degree. None for a body without thermal strain.
    """

    @property
    def dims(self) -> tuple[int, ...]:
        """Bodies in space; in the plane use `PlaneStrain` or `PlaneStress`."""
        return (3,)

    @property
    def parameters(self) -> tuple[float, ...]:
        """First Lamé parameter and shear modulus, [force / length²], and α where it was given."""
        return (*lame(self.young_modulus, self.poisson_ratio), *self.expansion)

    def stress(self, u: Expr, parameters: tuple[ufl.Constant, ...]) -> Expr:
        """Return σ(u) with ``parameters`` = (λ, G, ...)."""
        return parameters[0] * ufl.div(u) * ufl.Identity(3) + 2 * parameters[1] * strain(u)

    def thermal_stress(self, parameters: tuple[ufl.Constant, ...]) -> Expr:
        """Return (3λ + 2G) α I."""
        lame_parameter, shear, expansion = parameters
        return (3 * lame_parameter + 2 * shear) * expansion * ufl.Identity(3)
