"""Elastic foams: strongly compressible isotropic hyperelasticity in principal stretches."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
import ufl
from ufl.core.expr import Expr

from fenics_contact._base.checks import checked
from fenics_contact.errors import InvalidInputError
from fenics_contact.materials.elastic import check_expansion, numbers
from fenics_contact.materials.hyperelastic import (
    Hyperelasticity,
    check_exponents,
    check_moduli,
    deformation_gradient,
    gradient_in_space,
    gradient_of_sheet,
    isochoric_invariants,
    power_sum,
)


@dataclass(frozen=True)
@checked("shear_moduli", "exponents", "poisson_ratios")
class Hyperfoam(Hyperelasticity):
    """Elastomeric foam, W = Σ 2 μ_p/α_p² (λ₁^α_p + λ₂^α_p + λ₃^α_p − 3 + (J^(−α_p β_p) − 1) / β_p).

    λ are the principal stretches, J their product, β_p = ν_p / (1 − 2 ν_p); for ν_p = 0 the last term is
    −α_p ln J. The shear modulus of small strains is Σ μ_p. In the plane it is in plane strain.

    Attributes:
        shear_moduli: μ_p, [force / length²], of any sign.
        exponents: α_p, as many, not zero.
        poisson_ratios: ν_p in [0, 0.5), as many: how much a foam widens as it is pressed.
        thermal_expansion: Thermal expansion α, stretch per degree. None for a body without.

    References:
        B. Storåkers, On material representation and constitutive branching in finite compressible elasticity,
        J. Mech. Phys. Solids 34 (1986) 125-145.

    Example:
        >>> foam = Hyperfoam((0.16, 2e-5), (8.9, -4.8), (0.0, 0.0))
        >>> foam.nonlinear
        True
    """

    shear_moduli: tuple[float, ...]
    exponents: tuple[float, ...]
    poisson_ratios: tuple[float, ...]
    thermal_expansion: float | None = None

    def __post_init__(self) -> None:
        """Reject constants for which the energy of small strains is not positive."""
        check_expansion(self.thermal_expansion)
        order, count = "give one μ, one exponent and one ν for each term", np.size(self.shear_moduli)
        for name in ("shear_moduli", "exponents", "poisson_ratios"):
            object.__setattr__(self, name, numbers(name, getattr(self, name), count, order))
        check_exponents(self.exponents)
        if not all(0 <= nu < 0.5 for nu in self.poisson_ratios):
            raise InvalidInputError(
                f"poisson_ratios must lie between 0 and 0.5, got {self.poisson_ratios}: use another model"
            )
        check_moduli("the shear modulus Σ μ_p", sum(self.shear_moduli), self._bulk(self.shear_moduli))

    @property
    def parameters(self) -> tuple[float, ...]:
        """μ_1, μ_2, ..., [force / length²], and α if given; exponents and ν are part of the form."""
        return *self.shear_moduli, *self.expansion

    @property
    def _betas(self) -> list[float]:
        return [nu / (1 - 2 * nu) for nu in self.poisson_ratios]

    def _bulk(self, shear_moduli: Sequence[float]) -> float:
        """Return the bulk modulus of small strains, Σ 2 μ_p (1/3 + β_p)."""
        return sum(2 * mu * (1 / 3 + beta) for mu, beta in zip(shear_moduli, self._betas, strict=False))

    def energy(self, F: Expr, parameters: tuple[ufl.Constant, ...]) -> Expr:
        """Return W(F)."""
        return self._of_invariants(_invariants(F), parameters)

    def _of_invariants(self, own: Sequence[Expr], parameters: tuple[ufl.Constant, ...]) -> Expr:
        """Return W by Ī₁, Ī₂ and J: sums of powers of stretches are J^(α/3) times those without J."""
        first, second, J = own
        energy = 0
        for mu, alpha, beta in zip(parameters, self.exponents, self._betas, strict=False):
            volume = (J ** (-alpha * beta) - 1) / beta if beta else -alpha * ufl.ln(J)
            shape = J ** (alpha / 3) * power_sum(first, second, alpha / 2) - 3
            energy += 2 * mu / alpha**2 * (shape + volume)
        return energy

    def stress_across(
        self, F: Expr, stretch: Expr, parameters: tuple[ufl.Constant, ...]
    ) -> tuple[Expr, Expr]:
        """Return Σ 2 μ_p/α_p (λ^α_p − J^(−α_p β_p)), and its derivative by ln λ."""
        J = ufl.det(gradient_of_sheet(F, stretch))
        stress, slope = 0, 0
        for mu, alpha, beta in zip(parameters, self.exponents, self._betas, strict=False):
            stress += 2 * mu / alpha * (stretch**alpha - J ** (-alpha * beta))
            slope += 2 * mu * (stretch**alpha + beta * J ** (-alpha * beta))
        return stress, slope

    def first_piola(self, F: Expr, parameters: tuple[ufl.Constant, ...]) -> Expr:
        """Return the first Piola-Kirchhoff stress ∂W/∂F (as large as F, UFL), [force / length²]."""
        gradient = ufl.variable(F)
        own = [ufl.variable(each) for each in _invariants(gradient_in_space(gradient))]
        energy = self._of_invariants(own, parameters)
        return sum(ufl.diff(energy, one) * ufl.diff(one, gradient) for one in own)

    def tangent(self, u: Expr, du: Expr, v: Expr, parameters: tuple[ufl.Constant, ...]) -> Expr:
        """Return the growth of `work` with the displacement along ``du``; through invariants it is short."""
        F = ufl.variable(deformation_gradient(u))
        own = [ufl.variable(each) for each in _invariants(gradient_in_space(F))]
        slopes = [ufl.diff(self._of_invariants(own, parameters), one) for one in own]
        along_v, along_du = ([ufl.inner(ufl.diff(one, F), ufl.grad(w)) for one in own] for w in (v, du))
        tangent = sum(slope * ufl.derivative(a, u, du) for slope, a in zip(slopes, along_v, strict=True))
        for slope, a in zip(slopes, along_v, strict=True):
            tangent += sum(ufl.diff(slope, one) * b * a for one, b in zip(own, along_du, strict=True))
        return tangent

    def _moduli(self, dim: int, parameters: tuple[ufl.Constant, ...]) -> Expr:
        """Return ∂²W/∂F² at F = I."""
        shear, bulk = sum(parameters[: len(self.exponents)]), self._bulk(parameters)
        I = ufl.Identity(dim)  # noqa: E741
        i, j, k, l = ufl.indices(4)  # noqa: E741
        symmetric = I[i, k] * I[j, l] + I[i, l] * I[j, k]
        return ufl.as_tensor((bulk - 2 * shear / 3) * I[i, j] * I[k, l] + shear * symmetric, (i, j, k, l))


def _invariants(F: Expr) -> tuple[Expr, Expr, Expr]:
    """Return Ī₁, Ī₂ and J."""
    return *isochoric_invariants(F), ufl.det(F)
