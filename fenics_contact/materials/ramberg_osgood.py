"""Deformation plasticity: Ramberg and Osgood's nonlinear elasticity under large deformations."""

from __future__ import annotations

from dataclasses import dataclass
from typing import ClassVar

import numpy as np

from fenics_contact._base.checks import checked
from fenics_contact.errors import InvalidInputError
from fenics_contact.materials.elastic import check_isotropic
from fenics_contact.materials.plastic import HistoryMaterial, MaterialResponse, elastic_moduli


@dataclass(frozen=True)
@checked()
class RambergOsgood(HistoryMaterial):
    """Metals whose strain is a power of their stress, E ε = σ + a σ (σ / σ_0)^(n − 1) in tension.

    The theory of deformation plasticity, of bodies that are loaded once and in proportion, as for
    J-integrals: it unloads as it loads. E e = (1 + ν) s + (1 − 2 ν) σ_m I + 3/2 a (q / σ_0)^(n − 1) s,
    with the deviator s of Cauchy's stress, its mean σ_m and von Mises' q, and Almansi's strain
    e = ½ (I − F⁻ᵀF⁻¹), as in CalculiX. Stress is no derivative of an energy by F: the tangent is unsymmetric
    by strains. Plane bodies are in plane strain. Where det F ≤ 0 there is no stress (NaN).

    Attributes:
        young_modulus: Young's modulus E > 0, [force / length²].
        poisson_ratio: Poisson's ratio ν in (−1, 0.5) of small strains, dimensionless.
        yield_stress: σ_0 > 0, [force / length²].
        exponent: n ≥ 1.
        offset: a ≥ 0: the nonlinear strain at σ_0 is a σ_0 / E.
        thermal_expansion: Thermal expansion α, stretch per degree. None for a body without.

    References:
        W. Ramberg, W. R. Osgood: Description of stress-strain curves by three parameters. NACA TN 902, 1943.

    Example:
        >>> steel = RambergOsgood(1.9e5, 0.34, 900.0, 12.0, 0.45)
        >>> steel.history_size, steel.finite
        (0, True)
    """

    finite: ClassVar[bool] = True
    symmetric: ClassVar[bool] = False

    young_modulus: float
    poisson_ratio: float
    yield_stress: float
    exponent: float
    offset: float
    thermal_expansion: float | None = None

    def __post_init__(self) -> None:
        """Reject constants without a unique stress."""
        check_isotropic(self.young_modulus, self.poisson_ratio, self.thermal_expansion)
        numbers = self.yield_stress, self.exponent, self.offset
        if not (
            np.isfinite(numbers).all() and self.yield_stress > 0 and self.exponent >= 1 and self.offset >= 0
        ):
            raise InvalidInputError(
                f"yield_stress > 0, exponent >= 1 and offset >= 0 are needed, got {self.yield_stress!r}, "
                f"{self.exponent!r}, {self.offset!r}: give σ_0, n, a of E ε = σ + a σ (σ / σ_0)^(n − 1)"
            )

    @property
    def history_size(self) -> int:
        """Nothing is remembered."""
        return 0

    def respond(self, gradient: np.ndarray, history: np.ndarray, duration: float) -> MaterialResponse:
        """Return P and its exact tangent; nothing depends on history and duration."""
        F = np.eye(3) + gradient
        upright = np.linalg.det(F) > 0
        F = np.where(upright[:, None, None], F, np.eye(3))
        G, J = np.linalg.inv(F), np.linalg.det(F)
        inverse = G.swapaxes(1, 2) @ G  # b⁻¹
        cauchy, moduli = self._stress(0.5 * (np.eye(3) - inverse))
        by_F = 0.5 * (np.einsum("nkj,nli->nijkl", inverse, G) + np.einsum("nik,nlj->nijkl", inverse, G))
        growth = (moduli.reshape(-1, 9, 9) @ by_F.reshape(-1, 9, 9)).reshape(-1, 3, 3, 3, 3)
        growth += np.einsum("nij,nlk->nijkl", cauchy, G)
        stress = J[:, None, None] * cauchy @ G.swapaxes(1, 2)
        tangent = np.einsum("n,nimkl,njm->nijkl", J, growth, G, optimize=True)
        tangent -= np.einsum("nil,njk->nijkl", stress, G)
        for part in (stress, tangent):
            part[~upright] = np.nan
        return MaterialResponse(stress, tangent, history)

    def _stress(self, strain: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """Return σ and ∂σ/∂e, shapes (n, 3, 3) and (n, 3, 3, 3, 3)."""
        bulk, shear = elastic_moduli(self.young_modulus, self.poisson_ratio)
        one, volume = np.eye(3), np.trace(strain, axis1=1, axis2=2)
        deviator = strain - volume[:, None, None] / 3 * one
        size = np.sqrt(2 / 3) * np.linalg.norm(deviator, axis=(1, 2))
        mises, slope = self._mises(size, shear)
        at = np.where(size > 0, size, 1.0)
        secant = np.where(size > 0, mises / at, 3 * shear)
        stress = bulk * volume[:, None, None] * one + 2 / 3 * secant[:, None, None] * deviator
        spherical = np.einsum("ij,kl->ijkl", one, one)
        symmetric = np.einsum("ik,jl->ijkl", one, one)
        symmetric = 0.5 * (symmetric + symmetric.swapaxes(0, 1))
        bend = np.where(size > 0, 4 / 9 * (slope - secant) / at**2, 0.0)
        moduli = (
            bulk * spherical
            + 2 / 3 * secant[:, None, None, None, None] * (symmetric - spherical / 3)
            + bend[:, None, None, None, None] * np.einsum("nij,nkl->nijkl", deviator, deviator)
        )
        return stress, moduli

    def _mises(self, strain: np.ndarray, shear: float) -> tuple[np.ndarray, np.ndarray]:
        """Return q and dq/dε of ε = q / 3G + a q / E (q / σ_0)^(n − 1).

        The function of q is convex: Newton's method falls to it from where one of both terms is all.
        """
        power, E, limit = self.exponent, self.young_modulus, self.yield_stress
        q = 3 * shear * strain
        if self.offset > 0:
            q = np.minimum(q, limit * (strain * E / (self.offset * limit)) ** (1 / power))
        for _ in range(60):
            plastic = self.offset / E * (q / limit) ** (power - 1)
            rest = q / (3 * shear) + plastic * q - strain
            slope = 1 / (1 / (3 * shear) + power * plastic)
            q = q - slope * rest
            if not (np.abs(rest) > 1e-15 * strain).any():
                break
        plastic = self.offset / E * (q / limit) ** (power - 1)
        return q, 1 / (1 / (3 * shear) + power * plastic)
