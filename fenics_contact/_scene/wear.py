"""Wear of contact pairs: how deep sliding under pressure takes material away."""

from __future__ import annotations

from abc import ABC, abstractmethod
from collections.abc import Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

import numpy as np

from fenics_contact._base.checks import checked
from fenics_contact._scene.checks import check_not_negative, check_positive
from fenics_contact._scene.fields import OfPosition, gradients_of, not_negative
from fenics_contact._scene.surface_laws import ByPressure, integral_from_zero, rising
from fenics_contact.errors import InvalidInputError

if TYPE_CHECKING:
    from fenics_contact._scene.part import Around


class WearCurve(ABC):
    """How the depth that wears off per sliding distance follows the pressure, for a law of your own.

    Give `rate` and its derivative `growth`; use it as the coefficient of a `Wear`. Pressures are by
    undeformed area. The rate is zero without pressure and must not fall.

    Example:
        >>> class MildToSevere(WearCurve):
        ...     '''k p, and ten times as much beyond 200 N/mm².'''
        ...
        ...     def rate(self, pressure):
        ...         return 1e-8 * (pressure + 9.0 * np.maximum(pressure - 200.0, 0.0))
        ...
        ...     def growth(self, pressure):
        ...         return 1e-8 * np.where(pressure > 200.0, 10.0, 1.0)
        >>> MildToSevere().rate(np.array([100.0, 300.0]))
        array([1.0e-06, 1.2e-05])
    """

    @abstractmethod
    def rate(self, pressure: np.ndarray) -> np.ndarray:
        """Return the depth that wears off per sliding distance, dimensionless.

        Args:
            pressure: Pressures p ≥ 0, shape (n,), [force / length²].

        Returns:
            Shape (n,).
        """

    @abstractmethod
    def growth(self, pressure: np.ndarray) -> np.ndarray:
        """Return the derivative of `rate` by the pressure, [length² / force].

        Args:
            pressure: Pressures p ≥ 0, shape (n,), [force / length²].

        Returns:
            Shape (n,), not negative.
        """

    def work(self, pressure: np.ndarray) -> np.ndarray:
        """Return the integral of `rate` over the pressure from zero to p, [force / length²].

        By Gauss's quadrature unless a law knows better; only energies and searches for the next step use it.

        Args:
            pressure: Pressures p > 0, shape (n,), [force / length²].

        Returns:
            Shape (n,).
        """
        return integral_from_zero(self.rate, pressure)


@dataclass(frozen=True)
@checked()
class WearTable(ByPressure, WearCurve):
    """A wear coefficient that depends on the pressure: linear between values, constant beyond the ends.

    Attributes:
        pressure: Pressures p ≥ 0 by undeformed area, ascending, [force / length²].
        coefficient: The coefficient k ≥ 0 at each of them, [length² / force].

    Raises:
        InvalidInputError: If the numbers do not fit each other, or k(p) p falls anywhere.

    Example:
        >>> table = WearTable(pressure=(0.0, 100.0), coefficient=(1e-8, 3e-8))
        >>> table.rate(np.array([50.0]))  # 2e-8 times 50
        array([1.e-06])
    """

    symbol = "k"
    remedy = "spread its fall"
    pressure: Sequence[float]
    coefficient: Sequence[float]

    def rate(self, pressure: np.ndarray) -> np.ndarray:
        """Return k(p) p, see `WearCurve.rate`."""
        return self.product(pressure)


@dataclass(frozen=True)
class _Power(WearCurve):
    """(p − p₀)^m above a pressure p₀."""

    exponent: float
    least: float

    def rate(self, pressure: np.ndarray) -> np.ndarray:
        return np.asarray(np.maximum(pressure - self.least, 0.0) ** self.exponent)

    def growth(self, pressure: np.ndarray) -> np.ndarray:
        beyond, m = pressure - self.least, self.exponent
        return np.where(beyond > 0.0, m * np.maximum(beyond, np.finfo(float).tiny) ** (m - 1.0), 0.0)

    def work(self, pressure: np.ndarray) -> np.ndarray:
        return np.asarray(
            self.rate(pressure) * np.maximum(pressure - self.least, 0.0) / (self.exponent + 1.0)
        )


@dataclass(frozen=True)
@checked()
class Wear:
    """Archard's law: a contact loses the depth k p Δs where it slides by Δs under the pressure p.

    The depth is that of one implicit step: the pressure is the one at the end of the load step, which the
    loss has changed, so that steps may be as long as one likes; how much they err is what `wear_to` controls.
    Worn depth adds to the gaps of all later load steps. By default points slide as the load step says.

    Attributes:
        coefficient: Wear coefficient k > 0, [length² / force], the volume per force and distance: 1e-4
            mm³/(N m) are 1e-7 mm²/N. A function receives points of the slave, shape (n, dim), and returns k
            there, shape (n,). One that depends on the pressure is a `WearTable`, or a `WearCurve` of your
            own.
        hardness: Divides the coefficient, which is a number without dimension then, > 0, [force / length²].
        exponent: m > 0 of the rate k (p − p₀)^m; not beside a `WearCurve`.
        least_pressure: p₀ ≥ 0, up to which nothing wears, [force / length²].
        least_slip: Distance ≥ 0 of a load step that wears nothing, and by which larger ones count less,
            [length].
        sliding: Distance ≥ 0 by which surfaces slide in each cycle, in place of what the load step has,
            [length]: a number, as four strokes, or a function of points as before, as 2π r of a shaft that
            turns. None: the length of the slip of each point.
        cycles: How often each load step is repeated, > 0; steps may say otherwise, see `LoadStep`.
        share: Part of the depth that the slave loses, from 0 to 1; the rest is the master's. It matters where
            the shape follows, see `wear_to`.

    Raises:
        InvalidInputError: If a number is outside its range, or an exponent is given beside a curve.

    Example:
        >>> dry = Wear(1e-8, share=0.5)  # mm²/N: both surfaces wear alike
        >>> shaft = Wear(1e-8, sliding=lambda x: 2 * np.pi * np.hypot(x[:, 0], x[:, 1]), cycles=1e4)
        >>> hard = Wear(1e-4, hardness=7000.0)
    """

    coefficient: float | OfPosition | WearCurve
    hardness: float = 1.0
    exponent: float = 1.0
    least_pressure: float = 0.0
    least_slip: float = 0.0
    sliding: float | OfPosition | None = None
    cycles: float = 1.0
    share: float = 1.0

    def __post_init__(self) -> None:
        """Refuse what cannot be a law."""
        remedy = "give the depth per pressure and sliding distance, such as 1e-7 mm²/N; omit wear for none"
        if isinstance(self.coefficient, WearCurve):
            rising(self.coefficient, "rate", "wear", "wear")
            if (self.exponent, self.least_pressure) != (1.0, 0.0):
                raise InvalidInputError(
                    f"Wear by a curve has no exponent and no least pressure, got {self.exponent:g} and "
                    f"{self.least_pressure:g}: the curve alone says how wear follows the pressure"
                )
        elif not callable(self.coefficient):
            check_positive("Wear.coefficient", self.coefficient, remedy)
        for name in ("hardness", "exponent", "cycles"):
            check_positive(f"Wear.{name}", getattr(self, name), "leave it out for 1")
        for name in ("least_pressure", "least_slip"):
            check_not_negative(f"Wear.{name}", getattr(self, name), "leave it out for none")
        if isinstance(self.sliding, int | float):
            check_not_negative("Wear.sliding", self.sliding, "give the distance of one cycle")
        if not 0.0 <= self.share <= 1.0:
            raise InvalidInputError(
                f"Wear.share must lie between 0 and 1, got {self.share:g}: 1 wears the slave alone"
            )

    def check(self, scene: Around, surfaces: Sequence[Any]) -> None:
        """Reject wear of a surface that stays where it is; `surfaces`: of the pair, the slave first."""
        if scene.is_nonlinear and not scene.deforms_much:
            raise InvalidInputError(
                "wear needs linear materials or large deformations, got small ones that are nonlinear: give "
                "FinitePlasticity, or elastic constants"
            )
        shares = (self.share, 1.0 - self.share)
        worn = [side for side, share in zip(surfaces, shares, strict=False) if share > 0.0]
        for side in worn:
            places = [(part.in_words, part.body, part.surface) for part in scene.supports]
            held = [words for words, *place in places if place == [side.body, side.name]]
            tied = [tie.place for tie in scene.ties if side in tie.surfaces]
            if held or tied:
                raise InvalidInputError(
                    f"a surface that wears must be free, but {side.name!r} of body {side.body!r} is "
                    f"that of {(*held, *tied)[0]}, too: hold another, or let Wear.share be that of its mate"
                )

    @property
    def curve(self) -> WearCurve:
        """How the rate follows the pressure, but for a coefficient that does not."""
        given = self.coefficient
        return given if isinstance(given, WearCurve) else _Power(self.exponent, self.least_pressure)

    @property
    def by_slip(self) -> bool:
        """Whether surfaces slide as load steps say."""
        return self.sliding is None

    @property
    def functions(self) -> tuple[Any, ...]:
        """What is given as a function of the place."""
        given = (self.coefficient, self.sliding)
        return tuple(each for each in given if callable(each) and not isinstance(each, WearCurve))

    def factor_at(self, place: str, points: np.ndarray) -> np.ndarray:
        """Return by what the distance of a cycle and the curve are multiplied at points of the slave, (n,).

        `place`: of the pair, in words.
        """
        k: Any = 1.0 if isinstance(self.coefficient, WearCurve) else self.coefficient
        return not_negative(f"wear of {place}", k, points) * (self.cycles / self.hardness)

    def counted(self, distance: np.ndarray) -> np.ndarray:
        """Return the part of distances that counts, shape (n,), [length]."""
        return np.maximum(distance - self.least_slip, 0.0)

    def distance_at(self, place: str, points: np.ndarray, slip: np.ndarray) -> np.ndarray:
        """Return the distance of a cycle at points, whose slip has these lengths, shape (n,), [length]."""
        given: Any = self.sliding
        return self.counted(slip if self.by_slip else not_negative(f"sliding of {place}", given, points))

    def grows_at(self, distance: np.ndarray) -> np.ndarray:
        """Return marks of distances of which more would count, shape (n,)."""
        return np.asarray(distance > self.least_slip)

    def by_place(self, place: str, points: np.ndarray, slip: np.ndarray) -> np.ndarray:
        """Return the gradient of factor times distance by the points, as `distance_at`, shape (n, dim)."""
        factor, distance = self.factor_at(place, points), self.distance_at(place, points, slip)
        growing = factor * (distance > 0.0)
        parts = (self.coefficient, distance * self.cycles / self.hardness), (self.sliding, growing)
        slopes = [
            share[:, None] * gradients_of(f"wear of {place}", given, points, ())
            for given, share in parts
            if callable(given) and given in self.functions
        ]
        return np.asarray(sum(slopes, np.zeros(points.shape)))
