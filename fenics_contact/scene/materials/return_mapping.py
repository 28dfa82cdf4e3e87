"""Hardening laws and the radial return of von Mises plasticity, for all points at once."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from fenics_contact.errors import InvalidInputError


@dataclass(frozen=True)
class Hardening:
    """Yield stress by equivalent plastic strain α, σ_y = σ_0 + H α + (σ_∞ − σ_0)(1 − exp(−δ α)).

    Attributes:
        yield_stress: σ_0, [force / length²].
        slope: H, [force / length²].
        saturation_stress: σ_∞, [force / length²].
        saturation_rate: δ, per plastic strain.
    """

    yield_stress: float
    slope: float
    saturation_stress: float
    saturation_rate: float

    def at(self, alpha: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """Return the yield stress, which does not fall below zero, and its derivative by α."""
        gain, left = self.saturation_stress - self.yield_stress, np.exp(-self.saturation_rate * alpha)
        stress = self.yield_stress + self.slope * alpha + gain * (1 - left)
        slope = self.slope + gain * self.saturation_rate * left
        return np.maximum(stress, 0.0), np.where(stress > 0, slope, 0.0)


def check_plastic(
    young_modulus: float, yield_stress: float, slope: float, kinematic: float, saturation: tuple[float, float]
) -> None:
    """Reject constants for which plastic flow does not exist or is not unique.

    Args:
        young_modulus: E, already checked.
        yield_stress: σ_0.
        slope: H, of isotropic hardening.
        kinematic: C, of kinematic hardening.
        saturation: σ_∞ and δ.
    """
    if not (np.isfinite(yield_stress) and yield_stress > 0):
        raise InvalidInputError(
            f"yield_stress must be a positive number, got {yield_stress!r}: give it in force per area, for "
            "structural steel 235 N/mm²; a body that does not yield is IsotropicElasticity"
        )
    if not (np.isfinite(kinematic) and kinematic >= 0):
        raise InvalidInputError(
            f"kinematic_hardening must be a number of at least 0, got {kinematic!r}: give the slope of the "
            "back stress by plastic strain in tension, in force per area"
        )
    if not (np.isfinite(slope) and slope + kinematic > -young_modulus):
        raise InvalidInputError(
            f"isotropic_hardening must be a number above −E − kinematic_hardening = "
            f"{-young_modulus - kinematic:.6g}, got {slope!r}: with less, stress in tension falls faster "
            "than the bar unloads, and the strain is not unique"
        )
    stress, rate = saturation
    if not (np.isfinite(stress) and stress >= yield_stress and np.isfinite(rate) and rate >= 0):
        raise InvalidInputError(
            f"saturation_stress must be a number of at least yield_stress {yield_stress!r} and "
            f"saturation_rate one of at least 0, got {stress!r} and {rate!r}: give the stress at which "
            "hardening ends and how fast it is approached, 1/α, or neither"
        )


@dataclass(frozen=True, eq=False)
class Returned:
    """Where the return mapping ends.

    Attributes:
        stress: Shape (n, 3, 3), [force / length²].
        moduli: Consistent tangent ∂σ/∂ε, shape (n, 3, 3, 3, 3).
        flow: Increment of plastic strain, shape (n, 3, 3); zero where the step is elastic.
        alpha: Equivalent plastic strain at the end of the step, shape (n,).
    """

    stress: np.ndarray
    moduli: np.ndarray
    flow: np.ndarray
    alpha: np.ndarray


def radial_return(
    strain: np.ndarray,
    back: np.ndarray,
    alpha: np.ndarray,
    elastic: tuple[float, float],
    hardening: Hardening,
    kinematic: float = 0.0,
) -> Returned:
    """Map an elastic trial state back to the yield surface.

    Backward Euler for von Mises' yield function with associated flow, isotropic and Prager's kinematic
    hardening; the normal of the trial state is that of the final one.

    Args:
        strain: Trial elastic strain, shape (n, 3, 3).
        back: Back stress at the start of the step, deviatoric, shape (n, 3, 3).
        alpha: Equivalent plastic strain there, shape (n,).
        elastic: Bulk modulus and shear modulus.
        hardening: Yield stress by α.
        kinematic: Slope C of the back stress in tension.

    References:
        J. C. Simo, T. J. R. Hughes: Computational Inelasticity. Springer 1998, Boxes 3.1 and 3.2.
    """
    bulk, shear = elastic
    one = np.eye(3)
    volume = np.trace(strain, axis1=1, axis2=2)
    deviator = 2 * shear * (strain - volume[:, None, None] / 3 * one)
    relative = deviator - back
    length = np.linalg.norm(relative, axis=(1, 2))
    stiffness = 2 * shear + 2 / 3 * kinematic
    multiplier, slope = _multipliers(length, alpha, stiffness, hardening)
    normal = relative / np.where(length > 0, length, 1.0)[:, None, None]
    flow = multiplier[:, None, None] * normal
    theta = 1 - 2 * shear * multiplier / np.where(length > 0, length, 1.0)
    along = np.where(multiplier > 0, 2 * shear / (stiffness + 2 / 3 * slope) - 1 + theta, 0.0)
    spherical = np.einsum("ij,kl->ijkl", one, one)
    symmetric = np.einsum("ik,jl->ijkl", one, one)
    symmetric = 0.5 * (symmetric + symmetric.swapaxes(0, 1))
    moduli = (
        bulk * spherical
        + 2 * shear * theta[:, None, None, None, None] * (symmetric - spherical / 3)
        - 2 * shear * along[:, None, None, None, None] * np.einsum("nij,nkl->nijkl", normal, normal)
    )
    stress = deviator - 2 * shear * flow + bulk * volume[:, None, None] * one
    return Returned(stress, moduli, flow, alpha + np.sqrt(2 / 3) * multiplier)


def _multipliers(
    length: np.ndarray, alpha: np.ndarray, stiffness: float, hardening: Hardening
) -> tuple[np.ndarray, np.ndarray]:
    """Solve ‖ξ‖ − stiffness Δγ = √(2/3) σ_y(α + √(2/3) Δγ) for Δγ ≥ 0; return Δγ and dσ_y/dα there.

    Newton's method, with bisection where it leaves the bracket: softening ends with a kink at σ_y = 0.
    """
    multiplier, slope = np.zeros_like(length), np.zeros_like(length)
    root = np.sqrt(2.0 / 3.0)  # radius of the yield surface in deviatoric stress, per unit of yield stress
    radius = root * hardening.at(alpha)[0]
    flows = np.flatnonzero(length > radius * (1 + 1e-12))  # a state on the surface is elastic, not rounding
    size, alpha = length[flows], alpha[flows]
    low, high = np.zeros_like(size), size / stiffness
    guess = low
    for _ in range(60):
        stress, rate = hardening.at(alpha + root * guess)
        rest = size - stiffness * guess - root * stress
        low, high = np.where(rest >= 0, guess, low), np.where(rest <= 0, guess, high)
        step = guess + rest / (stiffness + 2 / 3 * rate)
        inside = (step >= low) & (step <= high)
        guess = np.where(inside, step, 0.5 * (low + high))
        if not (np.abs(rest) > 1e-14 * size).any():
            break
    multiplier[flows], slope[flows] = guess, hardening.at(alpha + root * guess)[1]
    return multiplier, slope
