"""The neo-Hookean model of compressible bodies."""

from __future__ import annotations

from dataclasses import dataclass

import ufl
from ufl.core.expr import Expr

from fenics_contact.checks import checked
from fenics_contact.scene.materials.constants import check_isotropic, lame
from fenics_contact.scene.materials.nearly_incompressible import NearlyIncompressible


@dataclass(frozen=True)
@checked()
class NeoHooke(NearlyIncompressible):
    """Compressible neo-Hookean elasticity, W = μ/2 (tr FᵀF − 3 − 2 ln J) + λ/2 (ln J)² with J = det F.

    Its linear part is isotropic elasticity with the same constants. In the plane it is in plane strain.

    Attributes:
        young_modulus: Young's modulus E > 0 of small strains, [force / length²].
        poisson_ratio: Poisson's ratio ν in (−1, 0.5) of small strains, dimensionless.
        mean_dilatation: Whether λ acts on the mean dilatation of each cell, against locking at ν near 0.5.

    References:
        J. Bonet, R. D. Wood, Nonlinear Continuum Mechanics for Finite Element Analysis, 2nd ed., Cambridge
        2008, section 6.4.3.
    """

    young_modulus: float
    poisson_ratio: float
    mean_dilatation: bool = False

    def __post_init__(self) -> None:
        """Reject constants for which the strain energy is not positive."""
        check_isotropic(self.young_modulus, self.poisson_ratio, None)

    @property
    def parameters(self) -> tuple[float, ...]:
        """First Lamé parameter and shear modulus, [force / length²]."""
        return lame(self.young_modulus, self.poisson_ratio)

    def shape_energy(self, F: Expr, parameters: tuple[ufl.Constant, ...]) -> Expr:
        """Return μ/2 (tr FᵀF − 3 − 2 ln J)."""
        return parameters[1] / 2 * (ufl.inner(F, F) - 3 - 2 * ufl.ln(ufl.det(F)))

    def volume_energy(self, J: Expr, parameters: tuple[ufl.Constant, ...]) -> Expr:
        """Return λ/2 (ln J)²."""
        return parameters[0] / 2 * ufl.ln(J) ** 2
