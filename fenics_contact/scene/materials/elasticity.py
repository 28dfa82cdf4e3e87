"""The base of small-strain elastic models: only the stress has to be written."""

from __future__ import annotations

from abc import ABC, abstractmethod

import numpy as np
import ufl
from ufl.core.expr import Expr

from fenics_contact.scene.kernels import rigid_body_modes


def strain(u: Expr) -> Expr:
    """Return the small strain ε(u) = ½ (∇u + ∇uᵀ)."""
    return ufl.sym(ufl.grad(u))


class Elasticity(ABC):
    """Elasticity with work σ(u) : ε(v) and rigid motions as its kernel; write `parameters` and `stress`.

    A plane model with stress normal to its plane adds the members of `Transverse`; otherwise its von Mises
    stress is that of plane stress. A model with thermal expansion adds those of `Thermoelastic`.

    Example:
        Two independent moduli, in the plane or in space:

        >>> from dataclasses import dataclass
        >>> import ufl
        >>> @dataclass(frozen=True)
        ... class BulkAndShear(Elasticity):
        ...     bulk: float
        ...     shear: float
        ...
        ...     @property
        ...     def parameters(self):
        ...         return self.bulk, self.shear
        ...
        ...     def stress(self, u, parameters):
        ...         bulk, shear = parameters
        ...         return bulk * ufl.div(u) * ufl.Identity(len(u)) + 2 * shear * ufl.dev(strain(u))
        >>> BulkAndShear(3.0, 1.0).dims
        (2, 3)
    """

    @property
    def dims(self) -> tuple[int, ...]:
        """Plane bodies and bodies in space, unless a model overrides it."""
        return (2, 3)

    @property
    @abstractmethod
    def parameters(self) -> tuple[float, ...]:
        """Values of the model's constants, in the order in which `stress` receives them."""

    @abstractmethod
    def stress(self, u: Expr, parameters: tuple[ufl.Constant, ...]) -> Expr:
        """Return the stress tensor (dim x dim, symmetric, UFL), linear in the displacement ``u``."""

    def stiffness(self, u: Expr, v: Expr, parameters: tuple[ufl.Constant, ...]) -> Expr:
        """Return σ(u) : ε(v)."""
        return ufl.inner(self.stress(u, parameters), strain(v))

    def kernel(self, points: np.ndarray) -> np.ndarray:
        """Return the rigid body modes."""
        return rigid_body_modes(points)
