"""A pin in a hole of nearly its size, with contact over a large arc.

Hertz's theory assumes that surfaces are nearly flat on the scale of the contact, unlike those of a pin in a
tight hole.

References:
    Persson, On the stress distribution of cylindrical elastic bodies in contact, Chalmers (1964).
    Ciavarella and Decuzzi, The state of stress induced by the plane frictionless cylindrical contact,
    Int. J. Solids Struct. 38 (2001), 4507-4523 and 4525-4533.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from scipy.optimize import brentq

from fenics_contact.errors import InvalidInputError
from fenics_contact.theory.arguments import require_numbers, require_positive


@dataclass(frozen=True)
class PinContact:
    """A contact over an arc.

    Attributes:
        half_angle: Half the contact angle, in radians.
        mean_pressure: Force per unit length over the radius, [force / length²].
    """

    half_angle: float
    mean_pressure: float

    @property
    def peak_pressure(self) -> float:
        """Pressure at the centre, [force / length²]."""
        return float(self.pressure(np.zeros(1))[0])

    def pressure(self, angle: np.ndarray) -> np.ndarray:
        """Return the pressure at angles from the centre, (n,) in radians, 0 outside the contact.

        With b = tan(ε/2), y = tan(θ/2) and s = √(b² − y²), r = √(b² + 1) it is

            p R / F = 2 s / (π r (1 + y²)) + ln((r + s) / (r − s)) / (2 π b² r²).
        """
        b = np.tan(self.half_angle / 2.0)
        inside = np.abs(angle) < self.half_angle
        y = np.tan(np.where(inside, angle, 0.0) / 2.0)
        s, r = np.sqrt(np.maximum(b**2 - y**2, 0.0)), np.hypot(b, 1.0)
        shape = 2.0 * s / (np.pi * r * (1.0 + y**2)) + np.arctanh(s / r) / (np.pi * (b * r) ** 2)
        return np.asarray(np.where(inside, self.mean_pressure * shape, 0.0))


def pin_in_hole(force: float, radius: float, clearance: float, modulus: float) -> PinContact:
    """Return the contact of a pin pressed against the side of a hole, both of one material.

    Pin and plate are in plane strain, the plate is wide compared with the hole, the force acts at the centre
    of the pin, and there is no friction. The half angle ε follows with b = tan(ε/2) from

        2 E* ΔR / F = (2 − ln(b² + 1) − 2 b⁴) / (π b² (b² + 1)).

    A loose or lightly loaded pin approaches `hertz_line` with κ = ΔR / R²; one without clearance has contact
    up to 84.8 degrees from the centre for any load.

    Args:
        force: F per unit length, [force / length].
        radius: R of the pin, [length].
        clearance: ΔR, radius of the hole less that of the pin, at least 0 and small compared with the radius.
        modulus: E*, see `contact_modulus`, of two bodies of one material.

    Raises:
        InvalidInputError: If the clearance is negative or not small, or another number is not positive.
    """
    require_positive(force=force, radius=radius, modulus=modulus)
    require_numbers(clearance=clearance)
    if not 0.0 <= clearance <= 0.1 * radius:
        raise InvalidInputError(
            f"clearance must lie between 0 and a tenth of the radius {radius}, got {clearance}: take "
            "hertz_line for a loose pin"
        )
    wanted = 2.0 * modulus * clearance / force

    def excess(logarithm: float) -> float:
        square = float(np.exp(2.0 * logarithm))  # b²
        right = (2.0 - np.log1p(square) - 2.0 * square**2) / (np.pi * square * (square + 1.0))
        return float(right - wanted)

    # The right side decreases; it exceeds 1 / (π b²) for b² < 1/4, and is negative for b = 1.
    lowest = -0.5 * float(np.log(np.pi * wanted + 4.0))
    b = np.exp(brentq(excess, lowest, 0.0, xtol=1e-15))
    return PinContact(float(2.0 * np.arctan(b)), float(force / radius))
