"""Contacts known by formula: Hertz's point and line, a pin in a hole, the relief of a roller.

References:
    Johnson, Contact mechanics, Cambridge University Press (1985), sections 4.1 and 4.2.
    Carlson, Numerical computation of real or complex elliptic integrals, Numer. Algorithms 10 (1995), 13-26.

Hertz's theory assumes that surfaces are nearly flat on the scale of the contact, unlike those of a pin in a
tight hole.

References:
    Persson, On the stress distribution of cylindrical elastic bodies in contact, Chalmers (1964).
    Ciavarella and Decuzzi, The state of stress induced by the plane frictionless cylindrical contact,
    Int. J. Solids Struct. 38 (2001), 4507-4523 and 4525-4533.

References:
    Lundberg, Elastische Berührung zweier Halbräume, Forsch. Geb. Ingenieurwes. 10 (1939), 201-211.
    Johns, Gohar, Roller bearings under radial and eccentric loads, Tribol. Int. 14 (1981), 131-136.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np

from fenics_contact.errors import InvalidInputError

__all__ = [
    "LineContact",
    "PinContact",
    "PointContact",
    "contact_modulus",
    "hertz_line",
    "hertz_point",
    "pin_in_hole",
    "relative_curvatures",
    "roller_relief",
]


def require_numbers(**given: Any) -> None:
    """Reject arguments, given by their names, that are not finite numbers."""
    for name, value in given.items():
        real = isinstance(value, int | float | np.integer | np.floating) and not isinstance(value, bool)
        if not (real and -np.inf < value < np.inf):
            raise InvalidInputError(f"{name} must be a finite number, got {value!r}: give another")


def require_positive(**given: Any) -> None:
    """Reject arguments, given by their names, that are not positive finite numbers."""
    require_numbers(**given)
    for name, value in given.items():
        if value <= 0.0:
            raise InvalidInputError(f"{name} must be positive, got {value}: give another")


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
            f"curvatures must differ by less than {SLENDEREST:g} times, got {low}, {high}: use hertz_line"
        )
    from scipy.special import ellipe, ellipkm1  # bodies without curved contact do without

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
    from scipy.special import elliprd

    def excess(logarithm: float) -> float:
        square = np.exp(2.0 * logarithm)
        return float(np.log(elliprd(0.0, 1.0, square) / elliprd(0.0, square, 1.0) / ratio))

    # The ratio of curvatures grows faster than a/b, and both are 1 together, up to rounding.
    lowest = -np.log(ratio) - 1.0
    return 1.0 if excess(0.0) >= 0.0 else float(np.exp(_root(excess, lowest, 0.0)))


def _root(function: Callable[[float], float], lowest: float, highest: float) -> float:
    """Return where a function crosses zero between two places."""
    from scipy.optimize import brentq  # as much to load as a small scene to assemble

    return float(brentq(function, lowest, highest, xtol=1e-15))


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


@dataclass(frozen=True)
class PinContact:
    """A contact over an arc.

    Attributes:
        half_angle: Half the contact angle, in radians.
        mean_pressure: Force per unit length over the radius, F / R, [force / length²]: the unit of Persson's
            pressures. It is twice the nominal bearing pressure F / (2 R), the mean over the pin's diameter.
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
            f"clearance must lie between 0 and {radius / 10:g}, got {clearance}: use hertz_line"
        )
    wanted = 2.0 * modulus * clearance / force

    def excess(logarithm: float) -> float:
        square = float(np.exp(2.0 * logarithm))  # b²
        right = (2.0 - np.log1p(square) - 2.0 * square**2) / (np.pi * square * (square + 1.0))
        return float(right - wanted)

    # The right side decreases; it exceeds 1 / (π b²) for b² < 1/4, and is negative for b = 1.
    lowest = -0.5 * float(np.log(np.pi * wanted + 4.0))
    b = np.exp(_root(excess, lowest, 0.0))
    return PinContact(float(2.0 * np.arctan(b)), float(force / radius))


def roller_relief(position: np.ndarray, length: float, half_width: float | None = None) -> np.ndarray:
    """Return the relief of a roller on a plane that makes its line load even, over A = w / (π E*).

    The line load w [force / length] acts on a half space. Under a line the surface sinks in the middle by
    A ln 1/(1 − (2y/l)²) more than at y, infinitely more than at the ends (Lundberg); under a strip with the
    pressure of Hertz over ±b, of constant width, at the ends by about A (1.1932 + ln l/(2b)).

    Args:
        position: y from the middle of the roller, between −l/2 and l/2, any shape, [length].
        length: Length l of the roller, [length].
        half_width: Hertz's half width b, [length]; None for a line.

    Returns:
        Relief over A, zero in the middle, infinite at the ends under a line.

    Raises:
        InvalidInputError: If a length is not positive or a position beyond the ends.

    Example:
        >>> import numpy as np
        >>> roller_relief(np.array([0.5, 0.9, 1.0]), 2.0, 0.1).round(4).tolist()
        [0.2862, 1.6082, 3.4967]
    """
    require_positive(length=length)
    relative = np.abs(np.asarray(position, dtype=float)) / (length / 2)
    if np.any(~(relative <= 1.0)):
        raise InvalidInputError(
            f"position must be within {length / 2:g} of the middle, got {np.max(np.abs(position)):g}"
        )
    if half_width is None:
        with np.errstate(divide="ignore"):
            return np.asarray(-np.log1p(-(relative**2)))
    require_positive(half_width=half_width)
    # ∫ p/r along y is the sum of two areas sinh; over x = b sin t the midpoint rule avoids x = 0.
    step = np.pi / 2 / 4000
    angle = np.arange(0.5 * step, np.pi / 2, step)
    share, x = 4.0 / np.pi * step * np.cos(angle) ** 2, np.sin(angle) * half_width

    def sunk(y: np.ndarray) -> np.ndarray:
        ends = [np.arcsinh((length / 2 + sign * y[..., None]) / x) for sign in (-1.0, 1.0)]
        return np.asarray((ends[0] + ends[1]) @ share)

    return np.maximum(sunk(np.zeros(1))[0] - sunk(relative * length / 2), 0.0)
