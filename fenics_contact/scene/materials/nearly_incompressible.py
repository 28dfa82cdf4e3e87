"""The base of hyperelastic models whose energy of volume changes stands apart."""

from __future__ import annotations

from abc import abstractmethod

import ufl
from ufl.core.expr import Expr

from fenics_contact.scene.materials.hyperelasticity import (
    Hyperelasticity,
    deformation_gradient,
    gradient_in_space,
)


class NearlyIncompressible(Hyperelasticity):
    """Hyperelasticity with W(F) = shape_energy(F) + volume_energy(J): write both and parameters.

    J = det F. With `mean_dilatation` the volume energy is that of the mean J of each cell,
    ∫ U(J) dV = V U(∫ J dV / V): each cell is asked to keep its volume, and not each of its points, which
    would make linear cells lock. All that grows with the bulk modulus must be in the volume energy.
    """

    mean_dilatation: bool = False

    @abstractmethod
    def shape_energy(self, F: Expr, parameters: tuple[ufl.Constant, ...]) -> Expr:
        """Return the energy density (UFL scalar) of changes of shape by F, 3 x 3, [force / length²]."""

    @abstractmethod
    def volume_energy(self, J: Expr, parameters: tuple[ufl.Constant, ...]) -> Expr:
        """Return the energy density (UFL scalar) of a change of volume by the factor J, [force / length²]."""

    def energy(self, F: Expr, parameters: tuple[ufl.Constant, ...]) -> Expr:
        """Return W(F)."""
        return self.shape_energy(F, parameters) + self.volume_energy(ufl.det(F), parameters)

    def shape_stress(self, F: Expr, parameters: tuple[ufl.Constant, ...]) -> Expr:
        """Return the derivative of the shape energy by F, 2 x 2 or 3 x 3."""
        gradient = ufl.variable(F)
        return ufl.diff(self.shape_energy(gradient_in_space(gradient), parameters), gradient)

    def first_piola(self, F: Expr, parameters: tuple[ufl.Constant, ...]) -> Expr:
        """Return the first Piola-Kirchhoff stress ∂W/∂F (as large as F, UFL), [force / length²]."""
        return self.shape_stress(F, parameters) + self.pressure(ufl.det(F), parameters) * cofactor(F)

    def shape_tangent(self, u: Expr, du: Expr, v: Expr, parameters: tuple[ufl.Constant, ...]) -> Expr:
        """Return the growth of the work of the shape stress on ``v`` with the displacement along ``du``."""
        stress = self.shape_stress(deformation_gradient(u), parameters)
        return ufl.derivative(ufl.inner(stress, ufl.grad(v)), u, du)

    def tangent(self, u: Expr, du: Expr, v: Expr, parameters: tuple[ufl.Constant, ...]) -> Expr:
        """Return the growth of the work of the shape stress with the displacement along ``du``."""
        pressure = self.pressure(ufl.det(deformation_gradient(u)), parameters)
        volume = ufl.derivative(pressure * volume_change(u, v), u, du)
        return self.shape_tangent(u, du, v, parameters) + volume

    def pressure(self, J: Expr, parameters: tuple[ufl.Constant, ...]) -> Expr:
        """Return U'(J), [force / length²]; positive in tension."""
        dilatation = ufl.variable(J)
        return ufl.diff(self.volume_energy(dilatation, parameters), dilatation)

    def bulk_modulus_at(self, J: Expr, parameters: tuple[ufl.Constant, ...]) -> Expr:
        """Return U''(J), [force / length²]."""
        dilatation = ufl.variable(J)
        return ufl.diff(ufl.diff(self.volume_energy(dilatation, parameters), dilatation), dilatation)

    def unseen_modulus(self, parameters: tuple[ufl.Constant, ...]) -> Expr:
        """Return what the shape energy lacks of the bulk modulus 2G/3 at F = I, [force / length²].

        With it the shape energy of small strains is G ε : ε, as in Lamé's form: no strain is without energy.
        """
        size = ufl.variable(ufl.as_ufl(0.0))
        shear = ufl.as_tensor([[1.0, size, 0.0], [0.0, 1.0, 0.0], [0.0, 0.0, 1.0]])
        along_shear, along_volume = (
            ufl.diff(ufl.diff(self.shape_energy(F, parameters), size), size)
            for F in (shear, (1.0 + size) * ufl.Identity(3))
        )
        return ufl.max_value(2 * along_shear / 3 - along_volume / 9, 0)


def cofactor(F: Expr) -> Expr:
    """Return ∂ det F/∂F."""
    gradient = ufl.variable(F)
    return ufl.diff(ufl.det(gradient), gradient)


def volume_change(u: Expr, v: Expr) -> Expr:
    """Return cof F : ∇v, the change of J along ``v``."""
    return ufl.inner(cofactor(deformation_gradient(u)), ufl.grad(v))


def has_mean_dilatation(material: object) -> bool:
    """Return whether a material feels the mean change of volume of each cell, not that of each point."""
    return bool(getattr(material, "mean_dilatation", False))
