"""Models whose shape energy is a function of two invariants."""

from __future__ import annotations

from abc import abstractmethod

import ufl
from ufl.core.expr import Expr

from fenics_contact.scene.materials.hyperelasticity import deformation_gradient, gradient_in_space
from fenics_contact.scene.materials.nearly_incompressible import NearlyIncompressible


class IsotropicRubber(NearlyIncompressible):
    """Isotropic models with a shape energy of Ī₁ and Ī₂, the invariants of FᵀF without its change of volume.

    Derivatives go through the two invariants, so that energies of hundreds of terms still compile in seconds.
    """

    @abstractmethod
    def invariant_energy(self, first: Expr, second: Expr, parameters: tuple[ufl.Constant, ...]) -> Expr:
        """Return the shape energy (UFL scalar) of the invariants, [force / length²]."""

    def shape_energy(self, F: Expr, parameters: tuple[ufl.Constant, ...]) -> Expr:
        """Return the shape energy of F, 3 x 3."""
        first, second = isochoric_invariants(F)
        return self.invariant_energy(first, second, parameters)

    def shape_stress(self, F: Expr, parameters: tuple[ufl.Constant, ...]) -> Expr:
        """Return the derivative of the shape energy by F, 2 x 2 or 3 x 3."""
        gradient = ufl.variable(F)
        own = [ufl.variable(invariant) for invariant in isochoric_invariants(gradient_in_space(gradient))]
        energy = self.invariant_energy(own[0], own[1], parameters)
        return sum(ufl.diff(energy, one) * ufl.diff(one, gradient) for one in own)

    def shape_tangent(self, u: Expr, du: Expr, v: Expr, parameters: tuple[ufl.Constant, ...]) -> Expr:
        """Return the growth of the work of the shape stress on ``v`` with the displacement along ``du``."""
        F = ufl.variable(deformation_gradient(u))
        own = [ufl.variable(invariant) for invariant in isochoric_invariants(gradient_in_space(F))]
        energy = self.invariant_energy(own[0], own[1], parameters)
        slopes = [ufl.diff(energy, one) for one in own]
        along_v, along_du = ([ufl.inner(ufl.diff(one, F), ufl.grad(w)) for one in own] for w in (v, du))
        tangent = sum(slope * ufl.derivative(a, u, du) for slope, a in zip(slopes, along_v, strict=True))
        for slope, a in zip(slopes, along_v, strict=True):
            tangent += sum(ufl.diff(slope, one) * b * a for one, b in zip(own, along_du, strict=True))
        return tangent

    def unseen_modulus(self, parameters: tuple[ufl.Constant, ...]) -> Expr:
        """Return 2G/3: changes of volume have no shape energy."""
        return 2 * self._shear_modulus(parameters) / 3

    def _shear_modulus(self, parameters: tuple[ufl.Constant, ...]) -> Expr:
        """Return 2 (∂/∂Ī₁ + ∂/∂Ī₂) at F = I."""
        own = [ufl.variable(ufl.as_ufl(3.0)) for _ in range(2)]
        energy = self.invariant_energy(own[0], own[1], parameters)
        return 2 * sum(ufl.diff(energy, one) for one in own)

    def _moduli(self, dim: int, parameters: tuple[ufl.Constant, ...]) -> Expr:
        """Return ∂²W/∂F² at F = I, of the shear modulus and the bulk modulus U''(1)."""
        shear = self._shear_modulus(parameters)
        bulk, I = self.bulk_modulus_at(ufl.as_ufl(1.0), parameters), ufl.Identity(dim)  # noqa: E741
        i, j, k, l = ufl.indices(4)  # noqa: E741
        symmetric = I[i, k] * I[j, l] + I[i, l] * I[j, k]
        return ufl.as_tensor((bulk - 2 * shear / 3) * I[i, j] * I[k, l] + shear * symmetric, (i, j, k, l))


def isochoric_invariants(F: Expr) -> tuple[Expr, Expr]:
    """Return the first and second invariant of C = FᵀF without its change of volume (det C = 1)."""
    C, J = F.T * F, ufl.det(F)
    first, second = ufl.tr(C), (ufl.tr(C) ** 2 - ufl.inner(C, C)) / 2
    return J ** (-2 / 3) * first, J ** (-4 / 3) * second
