"""Hardening of metals: stresses by plastic strain, and the return to the yield surface."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from fenics_contact.errors import InvalidInputError
from fenics_contact.materials.elastic import require_positive

#: Points of a curve: plastic strain, and stress [force / length²].
Points = tuple[tuple[float, float], ...]


@dataclass(frozen=True)
class Curve:
    """A stress by plastic strain: straight between points, with a slope beyond the last one.

    `points`: plastic strains, which ascend from zero, and stresses.
    """

    points: Points
    beyond: float = 0.0

    @property
    def slopes(self) -> np.ndarray:
        """Slopes from each point on, [force / length²]."""
        strains, stresses = np.array(self.points, dtype=np.float64).T
        return np.append(np.diff(stresses) / np.diff(strains), self.beyond)

    def at(self, alpha: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """Return the stress at plastic strains of at least zero, and its slope."""
        strains, stresses = np.array(self.points, dtype=np.float64).T
        k = np.searchsorted(strains, alpha, side="right") - 1
        slope = self.slopes[k]
        return stresses[k] + slope * (alpha - strains[k]), slope


#: No back stress.
NO_BACK_STRESS = Curve(((0.0, 0.0),))


@dataclass(frozen=True)
class Hardening:
    """Yield stress by equivalent plastic strain α, that of a curve and (σ_∞ − σ_0)(1 − exp(−δ α)).

    `gain`: σ_∞ − σ_0; `rate`: δ.
    """

    curve: Curve
    gain: float = 0.0
    rate: float = 0.0

    def at(self, alpha: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """Return the yield stress, which does not fall below zero, and its derivative by α."""
        left = np.exp(-self.rate * alpha)
        stress, slope = self.curve.at(alpha)
        stress = stress + self.gain * (1 - left)
        slope = slope + self.gain * self.rate * left
        return np.maximum(stress, 0.0), np.where(stress > 0, slope, 0.0)


def checked_curve(name: str, points: Sequence[Sequence[float]], first: float) -> Points:
    """Return the points of a curve that starts at plastic strain zero with a stress; () of none."""
    try:
        table = np.array(points, dtype=np.float64).reshape(len(points), 2)
    except (TypeError, ValueError):
        table = np.full((1, 2), np.nan)
    if not np.isfinite(table).all():
        raise InvalidInputError(
            f"{name} must be pairs (plastic strain, stress), got {points!r}: such as ((0.02, 290.0),)"
        )
    strains = np.append(0.0, table[:, 0])
    if (np.diff(strains) <= 0).any() or (table[:, 1] < 0).any():
        raise InvalidInputError(
            f"{name} must have ascending strains above 0 and no negative stress, got {points!r}: leave out "
            f"strain 0, where the stress is {first:g} already"
        )
    return tuple((float(strain), float(stress)) for strain, stress in table)


def check_plastic(young_modulus: float, hardening: Hardening, kinematic: Curve) -> None:
    """Reject constants for which plastic flow does not exist or is not unique."""
    yield_stress, slope = hardening.curve.points[0][1], float(hardening.curve.slopes.min())
    back = float(kinematic.slopes.min())
    require_positive("yield_stress", yield_stress, "235 N/mm² for structural steel, or IsotropicElasticity")
    if not (np.isfinite(back) and back >= 0):
        raise InvalidInputError(
            f"kinematic_hardening must be a number of at least 0, got {back!r}: give the slope of back stress"
        )
    if not (np.isfinite(slope) and slope + back > -young_modulus):
        raise InvalidInputError(
            f"isotropic_hardening must exceed −E − kinematic_hardening = {-young_modulus - back:.6g}, got "
            f"{slope!r}: with less the strain is not unique"
        )
    gain, rate = hardening.gain, hardening.rate
    if not (np.isfinite(gain) and gain >= 0 and np.isfinite(rate) and rate >= 0):
        raise InvalidInputError(
            f"saturation_stress must be at least the yield_stress {yield_stress!r} and saturation_rate at "
            f"least 0, got {yield_stress + gain!r} and {rate!r}: correct them, or leave out both"
        )


@dataclass(frozen=True, eq=False)
class Returned:
    """Where the return mapping ends.

    `moduli`: consistent tangent ∂σ/∂ε; `flow`: increment of plastic strain; zero where the step is elastic;
    `alpha`: equivalent plastic strain at the end of the step; `back`: increment of the back stress.
    """

    stress: np.ndarray
    moduli: np.ndarray
    flow: np.ndarray
    alpha: np.ndarray
    back: np.ndarray


def radial_return(
    strain: np.ndarray,
    back: np.ndarray,
    alpha: np.ndarray,
    elastic: tuple[float, float],
    hardening: Hardening,
    kinematic: Curve = NO_BACK_STRESS,
) -> Returned:
    """Map an elastic trial state back to the yield surface.

    Backward Euler for von Mises' yield function with associated flow, isotropic and kinematic hardening; the
    normal of the trial state is that of the final one. `back`: back stress at the start of the step,
    deviatoric; `alpha`: equivalent plastic strain there; `kinematic`: back stress in tension by equivalent
    plastic strain.

    References:
        J. C. Simo, T. J. R. Hughes: Computational Inelasticity. Springer 1998, Boxes 3.1 and 3.2.
    """
    bulk, shear = elastic
    one = np.eye(3)
    volume = np.trace(strain, axis1=1, axis2=2)
    deviator = 2 * shear * (strain - volume[:, None, None] / 3 * one)
    relative = deviator - back
    length = np.linalg.norm(relative, axis=(1, 2))
    flowing = multipliers(length, alpha, np.full_like(length, 2 * shear), hardening, kinematic)
    multiplier = flowing.multiplier
    normal = relative / np.where(length > 0, length, 1.0)[:, None, None]
    flow = multiplier[:, None, None] * normal
    theta = 1 - 2 * shear * multiplier / np.where(length > 0, length, 1.0)
    slope = 2 * shear + 2 / 3 * flowing.slope
    along = np.where(multiplier > 0, 2 * shear / slope - 1 + theta, 0.0)
    spherical = np.einsum("ij,kl->ijkl", one, one)
    symmetric = np.einsum("ik,jl->ijkl", one, one)
    symmetric = 0.5 * (symmetric + symmetric.swapaxes(0, 1))
    moduli = (
        bulk * spherical
        + 2 * shear * theta[:, None, None, None, None] * (symmetric - spherical / 3)
        - 2 * shear * along[:, None, None, None, None] * np.einsum("nij,nkl->nijkl", normal, normal)
    )
    stress = deviator - 2 * shear * flow + bulk * volume[:, None, None] * one
    growth = ROOT * flowing.back[:, None, None] * normal
    return Returned(stress, moduli, flow, alpha + ROOT * multiplier, growth)


#: Radius of the yield surface in deviatoric stress, per unit of yield stress.
ROOT = float(np.sqrt(2.0 / 3.0))


@dataclass(frozen=True, eq=False)
class Flowing:
    """How far points flow.

    `multiplier`: Δγ; zero where the step is elastic; `strength`: s σ_y at the end of the step; `slope`: slope
    by α of what holds them at the yield surface, s σ_y + b (β − β_n), zero where the step is elastic; `back`:
    β(α) − β(α_n).
    """

    multiplier: np.ndarray
    strength: np.ndarray
    slope: np.ndarray
    back: np.ndarray


def multipliers(
    length: np.ndarray,
    alpha: np.ndarray,
    stiffness: np.ndarray,
    hardening: Hardening,
    kinematic: Curve,
    scale: np.ndarray | float = 1.0,
    back_scale: np.ndarray | float = 1.0,
) -> Flowing:
    """Solve ‖ξ‖ − k Δγ = √(2/3) (s σ_y(α) + b (β(α) − β(α_n))) with α = α_n + √(2/3) Δγ for Δγ ≥ 0.

    Newton's method, with bisection where it leaves the bracket: curves have kinks, and softening ends with
    one at σ_y = 0.
    """
    s, b = (np.broadcast_to(np.asarray(each, dtype=np.float64), length.shape) for each in (scale, back_scale))
    multiplier, slope, back = np.zeros_like(length), np.zeros_like(length), np.zeros_like(length)
    strength = s * hardening.at(alpha)[0]
    # A state on the surface is elastic, not rounding.
    flows = np.flatnonzero(length > ROOT * strength * (1 + 1e-12))
    size, start, k, s, b = length[flows], alpha[flows], stiffness[flows], s[flows], b[flows]
    before = kinematic.at(start)[0]

    def held(guess: np.ndarray) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
        now = start + ROOT * guess
        (stress, rate), (pulled, along) = hardening.at(now), kinematic.at(now)
        return s * stress, pulled - before, s * rate + b * along

    low, high = np.zeros_like(size), size / k
    guess = low
    for _ in range(60):
        own, pulled, rate = held(guess)
        rest = size - k * guess - ROOT * (own + b * pulled)
        low, high = np.where(rest >= 0, guess, low), np.where(rest <= 0, guess, high)
        step = guess + rest / (k + 2 / 3 * rate)
        inside = (step >= low) & (step <= high)
        guess = np.where(inside, step, 0.5 * (low + high))
        if not (np.abs(rest) > 1e-14 * size).any():
            break
    multiplier[flows] = guess
    strength[flows], back[flows], slope[flows] = held(guess)
    return Flowing(multiplier, strength, slope, back)
