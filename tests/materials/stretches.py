"""Hyperelastic models beside their energies in principal stretches."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np

from fenics_contact.materials import Hyperelasticity, MooneyRivlin, NeoHooke, Ogden, StVenantKirchhoff
from fenics_contact.materials.elastic import lame

#: Energy density of principal stretches.
Energy = Callable[[np.ndarray], complex]
LAMBDA, MU = lame(10.0, 0.3)
EXPONENTS, MODULI = (1.3, -2.0), (2.0, -0.4)


def volume(x: np.ndarray) -> complex:
    return 12.0 / 2 * (x.prod() - 1) ** 2


def neo_hooke(x: np.ndarray) -> complex:
    log_J = np.log(x.prod())
    return MU / 2 * ((x**2).sum() - 3 - 2 * log_J) + LAMBDA / 2 * log_J**2


def st_venant_kirchhoff(x: np.ndarray) -> complex:
    E = (x**2 - 1) / 2
    return LAMBDA / 2 * E.sum() ** 2 + MU * (E**2).sum()


def mooney_rivlin(x: np.ndarray) -> complex:
    isochoric = (x / x.prod() ** (1 / 3)) ** 2
    return 1.5 * (isochoric.sum() - 3) + 0.5 * ((1 / isochoric).sum() - 3) + volume(x)


def ogden(x: np.ndarray) -> complex:
    isochoric = x / x.prod() ** (1 / 3)
    terms = zip(MODULI, EXPONENTS, strict=True)
    return sum(mu / a * ((isochoric**a).sum() - 3) for mu, a in terms) + volume(x)


MODELS: dict[str, tuple[Hyperelasticity, Energy]] = {
    "NeoHooke": (NeoHooke(10.0, 0.3), neo_hooke),
    "StVenantKirchhoff": (StVenantKirchhoff(10.0, 0.3), st_venant_kirchhoff),
    "MooneyRivlin": (MooneyRivlin(1.5, 0.5, 12.0), mooney_rivlin),
    "Ogden": (Ogden(MODULI, EXPONENTS, 12.0), ogden),
}


def stress(energy: Energy, stretches: np.ndarray, direction: int) -> float:
    """First Piola-Kirchhoff stress along a principal direction, by a complex step."""
    ahead = stretches.astype(complex)
    ahead[direction] += 1e-30j
    return float(np.imag(energy(ahead)) / 1e-30)
