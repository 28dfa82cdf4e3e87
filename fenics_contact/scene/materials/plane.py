"""Isotropic elasticity of plane bodies: plane strain and plane stress. Forces are per unit of thickness."""

from __future__ import annotations

from dataclasses import dataclass

import ufl
from ufl.core.expr import Expr

from fenics_contact.scene.materials.constants import lame
from fenics_contact.scene.materials.elasticity import strain
from fenics_contact.scene.materials.isotropic import Isotropic


@dataclass(frozen=True)
class PlaneStrain(Isotropic):
    """A slice of a long body that cannot strain along its length, σ = λ tr(ε) I + 2 G ε − ΔT (3λ + 2G) α I.

    Attributes:
        young_modulus: Young's modulus E > 0, [force / length²].
        poisson_ratio: Poisson's ratio ν in (−1, 0.5), dimensionless.
        thermal_expansion: Thermal expansion α, strain per degree. None for a body without thermal strain.
    """

    @property
    def dims(self) -> tuple[int, ...]:
        """Plane bodies."""
        return (2,)

    @property
    def parameters(self) -> tuple[float, ...]:
        """First Lamé parameter and shear modulus, [force / length²], and α where it was given."""
        return (*lame(self.young_modulus, self.poisson_ratio), *self.expansion)

    def stress(self, u: Expr, parameters: tuple[ufl.Constant, ...]) -> Expr:
        """Return σ(u) in the plane."""
        return parameters[0] * ufl.div(u) * ufl.Identity(2) + 2 * parameters[1] * strain(u)

    def transverse_stress(self, u: Expr, parameters: tuple[ufl.Constant, ...]) -> Expr:
        """Return λ tr(ε)."""
        return parameters[0] * ufl.div(u)

    def thermal_stress(self, parameters: tuple[ufl.Constant, ...]) -> Expr:
        """Return (3λ + 2G) α I."""
        return self.transverse_thermal_stress(parameters) * ufl.Identity(2)

    def transverse_thermal_stress(self, parameters: tuple[ufl.Constant, ...]) -> Expr:
        """Return (3λ + 2G) α."""
        lame_parameter, shear, expansion = parameters
        return (3 * lame_parameter + 2 * shear) * expansion


@dataclass(frozen=True)
class PlaneStress(Isotropic):
    """A thin plate without stress normal to it, σ = E/(1−ν²) ((1−ν) ε + ν tr(ε) I) − ΔT E/(1−ν) α I.

    Attributes:
        young_modulus: Young's modulus E > 0, [force / length²].
        poisson_ratio: Poisson's ratio ν in (−1, 0.5), dimensionless.
        thermal_expansion: Thermal expansion α, strain per degree. None for a body without thermal strain.
    """

    @property
    def dims(self) -> tuple[int, ...]:
        """Plane bodies."""
        return (2,)

    @property
    def parameters(self) -> tuple[float, ...]:
        """E, [force / length²], ν, and α where it was given."""
        return (self.young_modulus, self.poisson_ratio, *self.expansion)

    def stress(self, u: Expr, parameters: tuple[ufl.Constant, ...]) -> Expr:
        """Return σ(u) in the plane."""
        E, nu = parameters[0], parameters[1]
        return E / (1 - nu**2) * ((1 - nu) * strain(u) + nu * ufl.div(u) * ufl.Identity(2))

    def thermal_stress(self, parameters: tuple[ufl.Constant, ...]) -> Expr:
        """Return E α / (1 − ν) I."""
        E, nu, expansion = parameters
        return E * expansion / (1 - nu) * ufl.Identity(2)
