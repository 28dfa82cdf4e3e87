"""The St. Venant-Kirchhoff model: Hooke's law between the strains of large rotations."""

from __future__ import annotations

from dataclasses import dataclass

import ufl
from ufl.core.expr import Expr

from fenics_contact.checks import checked
from fenics_contact.scene.materials.constants import check_isotropic, lame
from fenics_contact.scene.materials.hyperelasticity import Hyperelasticity


@dataclass(frozen=True)
@checked()
class StVenantKirchhoff(Hyperelasticity):
    """Small strains under large rotations, W = λ/2 (tr E)² + μ E : E with E = (FᵀF − I) / 2.

    It softens under compression and lets cells collapse: a bar bears no larger load than at 58 % of its
    length. Take `NeoHooke` where strains are not small. In the plane it is in plane strain.

    Attributes:
        young_modulus: Young's modulus E > 0 of small strains, [force / length²].
        poisson_ratio: Poisson's ratio ν in (−1, 0.5) of small strains, dimensionless.
    """

    young_modulus: float
    poisson_ratio: float

    def __post_init__(self) -> None:
        """Reject constants for which the strain energy is not positive."""
        check_isotropic(self.young_modulus, self.poisson_ratio, None)

    @property
    def parameters(self) -> tuple[float, ...]:
        """First Lamé parameter and shear modulus, [force / length²]."""
        return lame(self.young_modulus, self.poisson_ratio)

    def energy(self, F: Expr, parameters: tuple[ufl.Constant, ...]) -> Expr:
        """Return W(F) with ``parameters`` = (λ, μ)."""
        lame_parameter, shear = parameters
        E = (F.T * F - ufl.Identity(3)) / 2
        return lame_parameter / 2 * ufl.tr(E) ** 2 + shear * ufl.inner(E, E)
