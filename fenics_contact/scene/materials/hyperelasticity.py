"""The base of models for large deformations that are given by their energy."""

from __future__ import annotations

from abc import abstractmethod
from typing import ClassVar

import ufl
from ufl.algorithms import expand_derivatives
from ufl.core.expr import Expr

from fenics_contact.scene.materials.elasticity import Elasticity, strain


class Hyperelasticity(Elasticity):
    """Elasticity for large deformations, given by its energy density W; write `parameters` and `energy`.

    W is the energy per undeformed volume, a function of the deformation gradient F = I + ∇u. F has three rows
    and columns in the plane, too, where F₃₃ = 1 (plane strain). The first Piola-Kirchhoff stress ∂W/∂F and
    its tangent follow by UFL. W must not change when the deformed body is rotated, and F = I must be free of
    stress. `stress` and `stiffness` are the model's linear part at F = I.

    Example:
        >>> from dataclasses import dataclass
        >>> import ufl
        >>> @dataclass(frozen=True)
        ... class CompressibleNeoHooke(Hyperelasticity):
        ...     shear: float
        ...     lame: float
        ...
        ...     @property
        ...     def parameters(self):
        ...         return self.shear, self.lame
        ...
        ...     def energy(self, F, parameters):
        ...         shear, lame = parameters
        ...         J = ufl.det(F)
        ...         volumetric = lame / 4 * (J**2 - 1 - 2 * ufl.ln(J))
        ...         return shear / 2 * (ufl.inner(F, F) - 3 - 2 * ufl.ln(J)) + volumetric
        >>> CompressibleNeoHooke(1.0, 1.0).nonlinear
        True
    """

    nonlinear: ClassVar[bool] = True

    @abstractmethod
    def energy(self, F: Expr, parameters: tuple[ufl.Constant, ...]) -> Expr:
        """Return W (UFL scalar), [force / length²], of a deformation gradient (3 x 3, UFL)."""

    def density(self, F: Expr, parameters: tuple[ufl.Constant, ...]) -> Expr:
        """Return W of a deformation gradient in the plane (2 x 2, in plane strain) or in space (3 x 3)."""
        return self.energy(gradient_in_space(F), parameters)

    def first_piola(self, F: Expr, parameters: tuple[ufl.Constant, ...]) -> Expr:
        """Return the first Piola-Kirchhoff stress ∂W/∂F (as large as F, UFL), [force / length²]."""
        gradient = ufl.variable(F)
        return ufl.diff(self.density(gradient, parameters), gradient)

    def cauchy(self, u: Expr, parameters: tuple[ufl.Constant, ...]) -> Expr:
        """Return Cauchy's stress P Fᵀ / det F of a displacement (3 x 3, UFL), [force / length²]."""
        F = gradient_in_space(deformation_gradient(u))
        return self.first_piola(F, parameters) * F.T / ufl.det(F)

    def work(self, u: Expr, v: Expr, parameters: tuple[ufl.Constant, ...]) -> Expr:
        """Return the work ∂W/∂F : ∇v of the stresses of ``u`` on ``v`` per undeformed volume."""
        return ufl.inner(self.first_piola(deformation_gradient(u), parameters), ufl.grad(v))

    def tangent(self, u: Expr, du: Expr, v: Expr, parameters: tuple[ufl.Constant, ...]) -> Expr:
        """Return the growth of `work` with the displacement along ``du``."""
        return ufl.derivative(self.work(u, v, parameters), u, du)

    def stress(self, u: Expr, parameters: tuple[ufl.Constant, ...]) -> Expr:
        """Return the linear part of the stress, ∂²W/∂F² at F = I times ε(u)."""
        dim = len(u)
        i, j, k, l = ufl.indices(4)  # noqa: E741
        moduli = self._moduli(dim, parameters)
        return ufl.as_tensor(moduli[i, j, k, l] * strain(u)[k, l], (i, j))

    def transverse_stress(self, u: Expr, parameters: tuple[ufl.Constant, ...]) -> Expr:
        """Return the linear part of the stress normal to the plane."""
        moduli, epsilon = self._moduli(3, parameters), strain(u)
        return sum(moduli[2, 2, i, j] * epsilon[i, j] for i in range(2) for j in range(2))

    def transverse_thermal_stress(self, parameters: tuple[ufl.Constant, ...]) -> Expr:
        """Return zero: the model has no thermal expansion."""
        return ufl.as_ufl(0.0)

    def _moduli(self, dim: int, parameters: tuple[ufl.Constant, ...]) -> Expr:
        """Return ∂²W/∂F² at F = I."""
        # The variable keeps UFL from simplifying the identity away before it has differentiated.
        F = ufl.variable(ufl.Identity(dim))
        return expand_derivatives(ufl.diff(ufl.diff(self.density(F, parameters), F), F))


def deformation_gradient(u: Expr) -> Expr:
    """Return F = I + ∇u."""
    return ufl.Identity(len(u)) + ufl.grad(u)


def gradient_in_space(F: Expr) -> Expr:
    """Return a deformation gradient as 3 x 3 tensor; one in the plane is that of plane strain."""
    if F.ufl_shape == (3, 3):
        return F
    return ufl.as_tensor([[F[0, 0], F[0, 1], 0], [F[1, 0], F[1, 1], 0], [0, 0, 1]])


def is_nonlinear(material: object) -> bool:
    """Return whether a material's stress is no linear function of the displacement."""
    return bool(getattr(material, "nonlinear", False))


def is_finite_strain(material: object) -> bool:
    """Return whether a material is made for large deformations, rotations included."""
    return is_nonlinear(material) and bool(getattr(material, "finite", True))
