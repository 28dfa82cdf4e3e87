"""How much heat passes between surfaces: by pressure where they touch, by the gap where they do not."""

from __future__ import annotations

from abc import ABC, abstractmethod
from collections.abc import Sequence
from dataclasses import dataclass, fields
from math import inf
from typing import TypeAlias

import numpy as np

from fenics_contact._base.checks import checked
from fenics_contact._scene.checks import check_not_negative, check_positive
from fenics_contact._scene.fields import finite_numbers
from fenics_contact.errors import InvalidInputError
from fenics_contact.errors.kinds import user_code
from fenics_contact.heat.parts import Radiation


@dataclass(frozen=True, eq=False)
class Touch:
    """What a conductance depends on, at each point, shape (n,) each.

    `pressure`: p ≥ 0, [force / length²]; `gap`: clearance ≥ 0, [length]; `slave` and `master`: temperatures
    of both sides; of curved gaps `spread`: their resistance over that of plane ones, and `ratio`: the area of
    the slave over that of the master opposite.
    """

    pressure: np.ndarray
    gap: np.ndarray
    slave: np.ndarray
    master: np.ndarray
    spread: np.ndarray
    ratio: np.ndarray

    def part(self, chosen: np.ndarray) -> Touch:
        """Return that of some points, by indices."""
        return Touch(*(getattr(self, each.name)[chosen] for each in fields(self)))


class Conductance(ABC):
    """A law of heat that passes between surfaces, q = h (T_slave − T_master), for one of your own.

    Example:
        >>> class Stepped(Conductance):
        ...     '''Much where surfaces touch, little elsewhere.'''
        ...
        ...     def at(self, touch):
        ...         return np.where(touch.pressure > 0.0, 1e-2, 1e-5)
    """

    #: Whether it depends on temperatures.
    by_temperature = False
    #: Whether it depends on pressures or gaps, which mechanics may change.
    by_contact = True
    # Temperatures must lie above it.
    absolute_zero: float = -inf

    @abstractmethod
    def at(self, touch: Touch) -> np.ndarray:
        """Return h ≥ 0 at points, shape (n,), [power / (length² · degree)]."""

    def require_rising(self, place: str) -> None:
        """Refuse a law that falls with the pressure: heat that expands bodies would part them.

        `place`: of the contact, in words.
        """
        pressure = np.concatenate([[0.0], np.logspace(-12, 12, 241)])
        one = np.ones(len(pressure))
        name = type(self).__name__
        with user_code(f"{name} as a law of conductance"):
            touch = Touch(pressure, one, 300.0 * one, 300.0 * one, one, one)
            h = np.asarray(self.at(touch), dtype=np.float64)
        falls = np.flatnonzero(np.diff(h) < -1e-9 * np.abs(h[1:])) if h.shape == one.shape else [0]
        if len(falls) or not np.isfinite(h).all():
            at = int(falls[0]) + 1 if len(falls) else int(np.argmin(np.isfinite(h)))
            raise InvalidInputError(
                f"the conductance {name} of {place} must be a number at each point and not fall with the "
                f"pressure, got {np.ravel(h)[at : at + 1]} at the pressure {pressure[at]:g}: keep it there"
            )

    def __add__(self, other: Conductance) -> Conductance:
        """Return the sum: heat takes both ways."""
        return SummedConductance((self, other))


@dataclass(frozen=True)
class SummedConductance(Conductance):
    """Laws whose heat adds up, as `law + other`."""

    parts: tuple[Conductance, ...]

    @property
    def by_temperature(self) -> bool:  # type: ignore[override]
        """Whether one of them depends on temperatures."""
        return any(each.by_temperature for each in self.parts)

    @property
    def by_contact(self) -> bool:  # type: ignore[override]
        """Whether one of them depends on pressures or gaps."""
        return any(each.by_contact for each in self.parts)

    @property
    def absolute_zero(self) -> float:  # type: ignore[override]
        """The highest one of all."""
        return max(each.absolute_zero for each in self.parts)

    def at(self, touch: Touch) -> np.ndarray:
        """Return the sum of all."""
        return np.asarray(sum(each.at(touch) for each in self.parts))


@dataclass(frozen=True)
@checked()
class EvenConductance(Conductance):
    """The same everywhere, at any pressure and gap; a number in its place means this.

    Attributes:
        value: h > 0, [power / (length² · degree)].
    """

    by_contact = False
    value: float

    def __post_init__(self) -> None:
        """Reject what does not conduct."""
        check_positive("EvenConductance.value", self.value, "leave the contact out where no heat passes")

    def at(self, touch: Touch) -> np.ndarray:
        """Return the value."""
        return np.full(len(touch.gap), float(self.value))


@dataclass(frozen=True)
@checked()
class ConductanceTable(Conductance):
    """By pressure where surfaces touch, by the gap where they do not: straight between values.

    Attributes:
        pressure: Pressures p ≥ 0, ascending, [force / length²].
        closed: h at each of them, must not fall; constant beyond the ends.
        gap: Clearances ≥ 0, ascending, [length]; none by default.
        open: h ≥ 0 at each of them, where surfaces are apart; zero beyond the last.

    Raises:
        InvalidInputError: If the numbers do not fit each other, or the conductance falls with the pressure.

    Example:
        >>> joint = ConductanceTable((0.0, 10.0), (1e-4, 5e-3), gap=(0.0, 0.02), open=(1e-4, 0.0))
    """

    pressure: Sequence[float]
    closed: Sequence[float]
    gap: Sequence[float] = ()
    open: Sequence[float] = ()

    def __post_init__(self) -> None:
        """Reject incomplete tables, and those that fall with the pressure."""
        for first, second in (("pressure", "closed"), ("gap", "open")):
            at, values = finite_numbers(getattr(self, first)), finite_numbers(getattr(self, second))
            known = at.ndim == 1 and at.shape == values.shape
            if not known or (np.diff(at) <= 0).any() or (at < 0).any() or (values < 0).any():
                raise InvalidInputError(
                    f"a ConductanceTable must have ascending {first} and as many values of {second}, none "
                    f"negative, got {getattr(self, first)!r} and {getattr(self, second)!r}: correct it"
                )
        if (np.diff(self.closed) < 0).any():
            raise InvalidInputError(
                f"a ConductanceTable must not fall with the pressure, got {tuple(self.closed)}: surfaces "
                "that are pressed together conduct better"
            )

    def at(self, touch: Touch) -> np.ndarray:
        """Return what the table says."""
        h = np.zeros(len(touch.gap))
        if len(self.gap):
            h = np.interp(touch.gap, self.gap, self.open, right=0.0)
        if len(self.pressure):
            h = np.where(touch.pressure > 0.0, np.interp(touch.pressure, self.pressure, self.closed), h)
        return h


@dataclass(frozen=True)
@checked()
class PressureConductance(Conductance):
    """A power of the pressure where surfaces touch: h = c (p / H)^m.

    `mikic` and `cooper_mikic_yovanovich` return those of rough metals.

    Attributes:
        coefficient: c > 0, [power / (length² · degree)].
        hardness: H > 0 of the softer surface, [force / length²].
        exponent: m > 0.

    Example:
        >>> rough = PressureConductance.cooper_mikic_yovanovich(0.05, 2000.0, roughness=1e-3, slope=0.1)
        >>> bool(rough.exponent == 0.95)
        True
    """

    coefficient: float
    hardness: float
    exponent: float = 1.0

    def __post_init__(self) -> None:
        """Reject laws that fall with the pressure."""
        for name in ("coefficient", "hardness", "exponent"):
            remedy = "conductance must grow with the pressure"
            check_positive(f"PressureConductance.{name}", getattr(self, name), remedy)

    def at(self, touch: Touch) -> np.ndarray:
        """Return c (p / H)^m."""
        ratio = np.maximum(touch.pressure, 0.0) / self.hardness
        return np.asarray(self.coefficient * ratio**self.exponent)

    @classmethod
    def cooper_mikic_yovanovich(
        cls, conductivity: float, hardness: float, *, roughness: float, slope: float
    ) -> PressureConductance:
        """Return h = 1.25 k (m / σ) (p / H)^0.95 of rough surfaces that yield where they touch.

        Args:
            conductivity: Harmonic mean k = 2 k₁ k₂ / (k₁ + k₂), see `harmonic_mean`.
            hardness: Microhardness H of the softer surface, [force / length²].
            roughness: Root of the sum of squares σ of both roughnesses, [length].
            slope: Root of the sum of squares m of both mean slopes of asperities.

        References:
            M. G. Cooper, B. B. Mikic, M. M. Yovanovich, Thermal contact conductance, Int. J. Heat Mass
            Transfer 12 (1969) 279-300; M. M. Yovanovich, Four decades of research on thermal contact, gap and
            joint resistance in microelectronics, IEEE Trans. Compon. Packag. Technol. 28 (2005) 182-206.
        """
        return cls(1.25 * conductivity * slope / roughness, hardness, 0.95)

    @classmethod
    def mikic(
        cls, conductivity: float, modulus: float, *, roughness: float, slope: float
    ) -> PressureConductance:
        """Return h = 1.55 k (m / σ) (√2 p / (E m))^0.94 of rough surfaces that deform elastically.

        Args:
            conductivity: As for `cooper_mikic_yovanovich`, as roughness and slope are.
            modulus: E = E₁E₂ / (E₂(1 − ν₁²) + E₁(1 − ν₂²)), [force / length²].
            roughness: σ, [length].
            slope: m.

        References:
            B. B. Mikić, Thermal contact conductance; theoretical considerations, Int. J. Heat Mass Transfer
            17 (1974) 205-214.
        """
        return cls(1.55 * conductivity * slope / roughness, modulus * slope / np.sqrt(2.0), 0.94)


def harmonic_mean(one: float, other: float) -> float:
    """Return 2 a b / (a + b), the mean by which conductivities and hardnesses of two bodies count."""
    return 2.0 * one * other / (one + other)


@dataclass(frozen=True)
@checked()
class GapConductance(Conductance):
    """A gas or liquid that fills the gap and conducts: h = k / (g + g₀), curved gaps by their own formula.

    Between curved surfaces the resistance is ∫ dt / (k (1 + t/R₁) (1 + t/R₂)) across the gap: in place of
    g it has R ln(1 + g/R) between cylinders, and g / (1 + g/R) between spheres.

    Attributes:
        conductivity: k > 0 of what fills the gap, [power / (length · degree)].
        least_gap: g₀ ≥ 0, the width that rough surfaces keep where they touch, and the jump distance of a
            gas, [length]; needed where gaps may close.
        curved: Whether curvature counts; without, the gap is plane at each point.

    Example:
        >>> air = GapConductance(2.6e-5, least_gap=1e-3)  # W/(mm K), mm
    """

    conductivity: float
    least_gap: float = 0.0
    curved: bool = True

    def __post_init__(self) -> None:
        """Reject gaps without resistance."""
        remedy = "give the sum of the roughnesses: without a width resistance would vanish where gaps close"
        check_positive("GapConductance.conductivity", self.conductivity, "still air has 0.026 W/(m K)")
        check_not_negative("GapConductance.least_gap", self.least_gap, remedy)

    def at(self, touch: Touch) -> np.ndarray:
        """Return k / (g + g₀)."""
        gap = np.maximum(touch.gap, 0.0) * (touch.spread if self.curved else 1.0)
        width = gap + self.least_gap
        if not (width > 0.0).all():
            raise InvalidInputError(
                "GapConductance needs a width at each point, got closed ones: give least_gap, such as the "
                "sum of the roughnesses"
            )
        return np.asarray(self.conductivity / width)


@dataclass(frozen=True)
@checked()
class GapRadiation(Conductance):
    """Radiation between two grey surfaces that face each other closely: q = σ F (T_s⁴ − T_m⁴).

    1/F = (1/ε_s − 1) + max(1, a) + a (1/ε_m − 1) with a = A_slave / A_master: that of wide parallel surfaces,
    and where they are curved of long concentric cylinders and of spheres.

    Attributes:
        slave_emissivity: ε_s in (0, 1].
        master_emissivity: ε_m in (0, 1].
        absolute_zero: Absolute zero on the scale of all temperatures: 0 in kelvin, −273.15 in °C.
        constant: σ in the units of the scene, see `Radiation`.
        curved: Whether curvature counts; without, the gap is plane at each point.
    """

    by_temperature = True
    by_contact = False
    slave_emissivity: float
    master_emissivity: float
    absolute_zero: float = 0.0
    constant: float = Radiation.constant
    curved: bool = True

    def __post_init__(self) -> None:
        """Reject surfaces that no body has."""
        for name in ("slave_emissivity", "master_emissivity"):
            if not 0.0 < getattr(self, name) <= 1.0:
                raise InvalidInputError(
                    f"GapRadiation.{name} must lie above 0 and up to 1, got {getattr(self, name)!r}: "
                    "polished metal has about 0.05, paint 0.9"
                )
        check_positive("GapRadiation.constant", self.constant, "give 5.670374419e-8 in W, m and K")

    def at(self, touch: Touch) -> np.ndarray:
        """Return σ F (T_s² + T_m²) (T_s + T_m)."""
        one, other = touch.slave - self.absolute_zero, touch.master - self.absolute_zero
        if min(one.min(initial=np.inf), other.min(initial=np.inf)) <= 0.0:
            raise InvalidInputError(
                f"GapRadiation needs temperatures above absolute zero, {self.absolute_zero:g} on this scale, "
                "got some below: give absolute_zero=-273.15 with degrees Celsius"
            )
        ratio = touch.ratio if self.curved else np.ones(len(one))
        lacking = (1.0 / self.slave_emissivity - 1.0) + ratio * (1.0 / self.master_emissivity - 1.0)
        factor = self.constant / (lacking + np.maximum(1.0, ratio))
        return np.asarray(factor * (one**2 + other**2) * (one + other))


#: A number, the same everywhere, or a law.
AnyConductance: TypeAlias = float | Conductance
