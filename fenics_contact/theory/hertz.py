"""Hertz's theory of the contact of two smooth bodies, at a point and along a line.

References:
    Johnson, Contact mechanics, Cambridge University Press (1985), sections 4.1 and 4.2.
    Carlson, Numerical computation of real or complex elliptic integrals, Numer. Algorithms 10 (1995), 13-26.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from scipy.optimize import brentq
from scipy.special import ellipe, ellipkm1, elliprd

from fenics_contact.errors import InvalidInputError
from fenics_contact.theory.arguments import require_numbers, require_positive

#: Largest ratio of the relative curvatures: beyond, a contact is a line contact.
SLENDEREST = 1e12


@dataclass(frozen=True)
class PointContact:
    """An elliptical contact.

    Attributes:
        semi_axes: Semi-axes along the directions of both relative curvatures, [length].
        peak_pressure: Pressure p0 at the centre, [force / length²].
        approach: Mutual approach of remote points of the two bodies, [length].
    """

    semi_axes: tuple[float, float]
    peak_pressure: float
    approach: float

    @property
    def area(self) -> float:
        """Area of the ellipse, [length²]."""
        return float(np.pi * self.semi_axes[0] * self.semi_axes[1])

    def pressure(self, x: np.ndarray, y: np.ndarray) -> np.ndarray:
        """Return the pressure p0 √(1 − x²/a² − y²/b²) at coordinates of any shape, 0 outside the ellipse."""
        a, b = self.semi_axes
        inside = 1.0 - (np.asarray(x) / a) ** 2 - (np.asarray(y) / b) ** 2
        return np.asarray(self.peak_pressure * np.sqrt(np.maximum(inside, 0.0)))


@dataclass(frozen=True)
class LineContact:
    """A line contact.

    Attributes:
        half_width: Half its width, [length].
        peak_pressure: Pressure p0 at the centre, [force / length²].
    """

    half_width: float
    peak_pressure: float

    def pressure(self, x: np.ndarray) -> np.ndarray:
        """Return the pressure p0 √(1 − x²/a²) at distances from the centre, 0 outside the strip."""
        inside = 1.0 - (np.asarray(x) / self.half_width) ** 2
        return np.asarray(self.peak_pressure * np.sqrt(np.maximum(inside, 0.0)))


def contact_modulus(young_1: float, poisson_1: float, young_2: float, poisson_2: float) -> float:
    """Return the modulus E* of two bodies in contact, 1/E* = (1 − ν₁²)/E₁ + (1 − ν₂²)/E₂.

    Args:
        young_1: Young's modulus of a body, [force / length²].
        poisson_1: Its Poisson's ratio.
        young_2: Young's modulus of the other; infinite if rigid.
        poisson_2: Its Poisson's ratio.

    Raises:
        InvalidInputError: If a modulus is not positive or a ratio not between -1 and 1/2.
    """
    require_positive(young_1=young_1)
    if young_2 != np.inf:
        require_positive(young_2=young_2)
    require_numbers(poisson_1=poisson_1, poisson_2=poisson_2)
    for name, ratio in (("poisson_1", poisson_1), ("poisson_2", poisson_2)):
        if not -1.0 < ratio <= 0.5:
            raise InvalidInputError(f"{name} must lie between -1 and 1/2, got {ratio}: steel has 0.3")
    return float(1.0 / ((1.0 - poisson_1**2) / young_1 + (1.0 - poisson_2**2) / young_2))


def relative_curvatures(
    first: Sequence[float], second: Sequence[float], angle: float = 0.0
) -> tuple[float, float]:
    """Return the principal curvatures κ₁ ≤ κ₂ of the gap between two surfaces that touch.

    In its principal directions the gap is κ₁ x²/2 + κ₂ y²/2.

    Args:
        first: Principal curvatures of a surface, positive where it is convex, [1 / length].
        second: Those of the other.
        angle: Angle between the first principal directions of both, in radians.

    Example:
        Crossed cylinders of radius 2 are equivalent to a ball of radius 2 and a plane.

        >>> import numpy as np
        >>> x, y = relative_curvatures((0.5, 0.0), (0.5, 0.0), np.pi / 2)
        >>> print(f"{x:.3f} and {y:.3f}")
        0.500 and 0.500
    """
    for name, curvatures in (("first", first), ("second", second)):
        if len(curvatures) != 2:
            raise InvalidInputError(f"{name} must be two principal curvatures, got {len(curvatures)}")
        require_numbers(**{f"{name}[{number}]": value for number, value in enumerate(curvatures)})
    require_numbers(angle=angle)
    mean = (first[0] + first[1] + second[0] + second[1]) / 2.0
    one, two = (first[0] - first[1]) / 2.0, (second[0] - second[1]) / 2.0
    deviation = np.hypot(one + two * np.cos(2.0 * angle), two * np.sin(2.0 * angle))
    return float(mean - deviation), float(mean + deviation)


def hertz_point(force: float, curvatures: Sequence[float], modulus: float) -> PointContact:
    """Return the contact of two bodies that touch at a point, pressed together without friction.

    With k = b/a ≤ 1, m = 1 − k² and the complete elliptic integrals K(m) and E(m),

        κ_b / κ_a = R_D(0, 1, k²) / R_D(0, k², 1),    a³ = 3 F E(m) / (π k² E* (κ_a + κ_b)),
        p0 = 3 F / (2 π a b),                         δ = p0 b K(m) / E*.

    Args:
        force: F, [force].
        curvatures: Relative curvatures along x and y, both positive, see `relative_curvatures`,
            [1 / length].
        modulus: E*, see `contact_modulus`.

    Returns:
        The ellipse, with semi-axes along x and y.

    Raises:
        InvalidInputError: If a number is not positive, or the surfaces touch along a line.

    Example:
        Two links of a chain, whose crowns have radii of 11 mm along the ring and 9 mm across the wire.

        >>> import numpy as np
        >>> link = (1 / 9.0, -1 / 11.0)
        >>> steel = contact_modulus(2.1e5, 0.3, 2.1e5, 0.3)
        >>> spot = hertz_point(80e3, relative_curvatures(link, link, np.pi / 2), steel)
        >>> print(f"{spot.peak_pressure:.0f} MPa on {spot.area:.1f} mm²")
        4382 MPa on 27.4 mm²
    """
    if len(curvatures) != 2:
        raise InvalidInputError(f"curvatures must be two relative curvatures, got {len(curvatures)}")
    low, high = sorted(curvatures)
    require_positive(force=force, modulus=modulus, **{"curvatures[0]": low, "curvatures[1]": high})
    if high > SLENDEREST * low:
        raise InvalidInputError(
            f"curvatures must differ by less than a factor of {SLENDEREST:g}, got {low} and {high}: take "
            "hertz_line, the surfaces touch along a line"
        )
    k = _axes_ratio(high / low)
    mean_integral = ellipe((1.0 - k) * (1.0 + k))
    a = np.cbrt(3.0 * force * mean_integral / (np.pi * k**2 * modulus * (low + high)))
    b = k * a
    peak = 1.5 * force / (np.pi * a * b)
    approach = peak * b * ellipkm1(k**2) / modulus
    axes = (a, b) if curvatures[0] <= curvatures[1] else (b, a)
    return PointContact((float(axes[0]), float(axes[1])), float(peak), float(approach))


def _axes_ratio(ratio: float) -> float:
    """Return b/a ≤ 1 for κ_b/κ_a ≥ 1."""

    def excess(logarithm: float) -> float:
        square = np.exp(2.0 * logarithm)
        return float(np.log(elliprd(0.0, 1.0, square) / elliprd(0.0, square, 1.0) / ratio))

    # The ratio of curvatures grows faster than a/b, and both are 1 together, up to rounding.
    lowest = -np.log(ratio) - 1.0
    return 1.0 if excess(0.0) >= 0.0 else float(np.exp(brentq(excess, lowest, 0.0, xtol=1e-15)))


def hertz_line(force: float, curvature: float, modulus: float) -> LineContact:
    """Return the contact of two bodies that touch along a line, pressed together without friction.

    a² = 4 F / (π E* κ), p0 = 2 F / (π a).

    Args:
        force: F per unit length, [force / length].
        curvature: Relative curvature κ across the line, the sum of those of both surfaces, [1 / length].
        modulus: E*, see `contact_modulus`; bodies are in plane strain.

    Raises:
        InvalidInputError: If a number is not positive.
    """
    require_positive(force=force, curvature=curvature, modulus=modulus)
    half_width = np.sqrt(4.0 * force / (np.pi * modulus * curvature))
    return LineContact(float(half_width), float(2.0 * force / (np.pi * half_width)))
