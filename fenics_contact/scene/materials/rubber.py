"""Models of rubber: Mooney-Rivlin and Ogden."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
import ufl
from ufl.core.expr import Expr

from fenics_contact.checks import checked
from fenics_contact.errors import InvalidInputError
from fenics_contact.scene.materials.constants import numbers
from fenics_contact.scene.materials.invariants import IsotropicRubber
from fenics_contact.scene.materials.power_sums import power_sum


@dataclass(frozen=True)
@checked()
class MooneyRivlin(IsotropicRubber):
    """Rubber under moderate strains, W = c10 (Ī₁ − 3) + c01 (Ī₂ − 3) + K/2 (J − 1)².

    Ī₁ and Ī₂ are the invariants of FᵀF without its change of volume. The shear modulus of small strains is
    2 (c10 + c01). With c01 = 0 it is a neo-Hookean model. In the plane it is in plane strain.

    Attributes:
        c10: Constant c10, [force / length²]; c10 + c01 > 0.
        c01: Constant c01, [force / length²].
        bulk_modulus: Bulk modulus K > 0, [force / length²].
        mean_dilatation: Whether K acts on the mean dilatation of each cell, against locking where K is large.

    References:
        R. W. Ogden, Non-Linear Elastic Deformations, Ellis Horwood 1984, chapter 7.
    """

    c10: float
    c01: float
    bulk_modulus: float
    mean_dilatation: bool = False

    def __post_init__(self) -> None:
        """Reject constants for which the energy of small strains is not positive."""
        _check_moduli("2 (c10 + c01)", 2 * (self.c10 + self.c01), self.bulk_modulus)

    @property
    def parameters(self) -> tuple[float, ...]:
        """The constants c10, c01 and K, [force / length²]."""
        return self.c10, self.c01, self.bulk_modulus

    def invariant_energy(self, first: Expr, second: Expr, parameters: tuple[ufl.Constant, ...]) -> Expr:
        """Return c10 (Ī₁ − 3) + c01 (Ī₂ − 3)."""
        return parameters[0] * (first - 3) + parameters[1] * (second - 3)

    def volume_energy(self, J: Expr, parameters: tuple[ufl.Constant, ...]) -> Expr:
        """Return K/2 (J − 1)²."""
        return parameters[2] / 2 * (J - 1) ** 2


@dataclass(frozen=True)
@checked("shear_moduli", "exponents")
class Ogden(IsotropicRubber):
    """Rubber under large strains, W = Σ μ_p/α_p (λ̄₁^α_p + λ̄₂^α_p + λ̄₃^α_p − 3) + K/2 (J − 1)².

    λ̄ are the principal stretches without the change of volume. The shear modulus of small strains is
    ½ Σ μ_p α_p. In the plane it is in plane strain.

    Attributes:
        shear_moduli: μ_p, [force / length²], of any sign.
        exponents: α_p, as many, not zero.
        bulk_modulus: Bulk modulus K > 0, [force / length²].
        mean_dilatation: Whether K acts on the mean dilatation of each cell, against locking where K is large.

    References:
        R. W. Ogden, Large deformation isotropic elasticity, Proc. R. Soc. Lond. A 326 (1972) 565-584.
    """

    shear_moduli: tuple[float, ...]
    exponents: tuple[float, ...]
    bulk_modulus: float
    mean_dilatation: bool = False

    def __post_init__(self) -> None:
        """Reject constants for which the energy of small strains is not positive."""
        order = "give one μ and one exponent for each term"
        count = np.size(self.shear_moduli)
        for name in ("shear_moduli", "exponents"):
            object.__setattr__(self, name, numbers(name, getattr(self, name), count, order))
        if not all(self.exponents):
            raise InvalidInputError(
                f"exponents must not be zero, got {self.exponents}: leave out the terms without influence"
            )
        shear = sum(mu * alpha for mu, alpha in zip(self.shear_moduli, self.exponents, strict=True)) / 2
        _check_moduli("½ Σ μ_p α_p", shear, self.bulk_modulus)

    @property
    def parameters(self) -> tuple[float, ...]:
        """μ_1, μ_2, ... and K, [force / length²]; the exponents are part of the form."""
        return *self.shear_moduli, self.bulk_modulus

    def invariant_energy(self, first: Expr, second: Expr, parameters: tuple[ufl.Constant, ...]) -> Expr:
        """Return Σ μ_p/α_p (λ̄₁^α_p + λ̄₂^α_p + λ̄₃^α_p − 3)."""
        return sum(
            shear / alpha * (power_sum(first, second, alpha / 2) - 3)
            for shear, alpha in zip(parameters, self.exponents, strict=False)
        )

    def volume_energy(self, J: Expr, parameters: tuple[ufl.Constant, ...]) -> Expr:
        """Return K/2 (J − 1)²."""
        return parameters[-1] / 2 * (J - 1) ** 2


def _check_moduli(name: str, shear_modulus: float, bulk_modulus: float) -> None:
    """Reject moduli of small strains that are not positive."""
    if not min(shear_modulus, bulk_modulus) > 0 or not np.isfinite([shear_modulus, bulk_modulus]).all():
        raise InvalidInputError(
            f"the moduli of small strains must be positive numbers, got the shear modulus {name} = "
            f"{shear_modulus:g} and bulk_modulus {bulk_modulus:g}: give constants in force per area"
        )
