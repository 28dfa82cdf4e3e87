"""What a material model must provide."""

from __future__ import annotations

from typing import Protocol, runtime_checkable

import numpy as np
import ufl
from ufl.core.expr import Expr


@runtime_checkable
class Material(Protocol):
    """A linear elastic model; `Elasticity` and `EnergyModel` leave only two of these members to write.

    Numbers that may differ from body to body are returned by `parameters` and reach the forms as UFL
    constants, so that all bodies of one class share one compiled form. A model is a value: equal models are
    interchangeable, and it can be hashed, as a frozen dataclass of numbers and tuples can.
    """

    @property
    def dims(self) -> tuple[int, ...]:
        """Dimensions of the bodies that it is for, ``(2,)``, ``(3,)`` or ``(2, 3)``."""

    @property
    def parameters(self) -> tuple[float, ...]:
        """Values of the model's constants, in the order in which the forms receive them."""

    def stress(self, u: Expr, parameters: tuple[ufl.Constant, ...]) -> Expr:
        """Return the stress tensor (dim x dim, UFL) of the displacement ``u``."""

    def stiffness(self, u: Expr, v: Expr, parameters: tuple[ufl.Constant, ...]) -> Expr:
        """Return the integrand of the symmetric bilinear form, virtual work per volume (UFL scalar)."""

    def kernel(self, points: np.ndarray) -> np.ndarray:
        """Return the zero-energy modes at ``points``, shape (n, dim) -> (n, dim, n_modes)."""


@runtime_checkable
class Thermoelastic(Protocol):
    """What a material must provide in addition for `ThermalStrain` to act on it."""

    @property
    def expands(self) -> bool:
        """Whether this material was given a thermal expansion."""

    def thermal_stress(self, parameters: tuple[ufl.Constant, ...]) -> Expr:
        """Return the stress that free expansion relieves per degree of temperature rise (dim x dim, UFL).

        σ = stress(u) − ΔT · thermal_stress; for an isotropic body (3λ + 2G) α I.
        """


@runtime_checkable
class Transverse(Protocol):
    """What a plane model provides in addition if it has stress normal to its plane (plane strain)."""

    def transverse_stress(self, u: Expr, parameters: tuple[ufl.Constant, ...]) -> Expr:
        """Return the stress normal to the plane (UFL scalar), without thermal strain."""

    def transverse_thermal_stress(self, parameters: tuple[ufl.Constant, ...]) -> Expr:
        """Return by how much it falls per degree of temperature rise (UFL scalar)."""


def can_expand(material: Material) -> bool:
    """Return whether a temperature change strains the material."""
    return isinstance(material, Thermoelastic) and material.expands
