"""Materials of a user, written in several ways, and one that nothing moves freely."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np
import ufl

from fenics_contact.materials import Elasticity, EnergyModel, strain

YOUNG, POISSON = 210.0, 0.3


@dataclass(frozen=True)
class _Lame:
    """Parameters of an isotropic material."""

    lame: float
    shear: float

    @property
    def parameters(self) -> tuple[float, float]:
        return self.lame, self.shear


@dataclass(frozen=True)
class FromEnergy(_Lame, EnergyModel):
    def energy(self, strain: Any, parameters: Any) -> Any:
        lame, shear = parameters
        return lame / 2 * ufl.tr(strain) ** 2 + shear * ufl.inner(strain, strain)


@dataclass(frozen=True)
class FromStress(_Lame, Elasticity):
    def stress(self, u: Any, parameters: Any) -> Any:
        lame, shear = parameters
        return lame * ufl.div(u) * ufl.Identity(len(u)) + 2 * shear * strain(u)


@dataclass(frozen=True)
class EnergyByEntries(_Lame, EnergyModel):
    """The same in the plane, written with single entries of the strain."""

    def energy(self, strain: Any, parameters: Any) -> Any:
        lame, shear = parameters
        x, y, xy = strain[0, 0], strain[1, 1], strain[0, 1]
        return lame / 2 * (x + y) ** 2 + shear * (x * x + y * y + 2 * xy * xy)


LAME = (YOUNG * POISSON / ((1 + POISSON) * (1 - 2 * POISSON)), YOUNG / (2 * (1 + POISSON)))


@dataclass(frozen=True)
class Foundation(Elasticity):
    """Springs that hold every point of the body: no motion is free."""

    stiffness_of_springs: float

    @property
    def parameters(self) -> tuple[float]:
        return (self.stiffness_of_springs,)

    def stress(self, u: Any, parameters: Any) -> Any:
        return ufl.tr(strain(u)) * ufl.Identity(len(u)) + 2 * strain(u)

    def stiffness(self, u: Any, v: Any, parameters: Any) -> Any:
        return ufl.inner(self.stress(u, parameters), strain(v)) + parameters[0] * ufl.inner(u, v)

    def kernel(self, points: np.ndarray) -> np.ndarray:
        return np.zeros((*points.shape, 0))
