"""Laws of surfaces: how far they give way under pressure, and how large friction may become."""

from __future__ import annotations

from abc import ABC, abstractmethod
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from typing import Any, ClassVar

import numpy as np

from fenics_contact._base.checks import checked
from fenics_contact._scene.checks import check_positive
from fenics_contact.errors import InvalidInputError
from fenics_contact.errors.kinds import user_code


class FrictionCurve(ABC):
    """How the largest friction traction follows the pressure, for a law of your own.

    Give `strength`, its derivative `growth` and `largest_coefficient`; use it as the coefficient of a
    `Coulomb`. Tractions and pressures are by undeformed area. The strength is zero without pressure and must
    not fall: a coefficient may fall with the pressure, but not as fast as one over it.

    Example:
        >>> class Saturating(FrictionCurve):
        ...     '''t = μ p / (1 + p / 100).'''
        ...
        ...     largest_coefficient = 0.3
        ...
        ...     def strength(self, pressure):
        ...         return 0.3 * pressure / (1 + pressure / 100)
        ...
        ...     def growth(self, pressure):
        ...         return 0.3 / (1 + pressure / 100) ** 2
        >>> Saturating().strength(np.array([100.0]))
        array([15.])
    """

    #: The least μ with strength(p) ≤ μ p at all pressures.
    largest_coefficient: float

    @abstractmethod
    def strength(self, pressure: np.ndarray) -> np.ndarray:
        """Return the largest friction traction, [force / length²].

        Args:
            pressure: Pressures p ≥ 0, shape (n,), [force / length²].

        Returns:
            Shape (n,).
        """

    @abstractmethod
    def growth(self, pressure: np.ndarray) -> np.ndarray:
        """Return the derivative of `strength` by the pressure, dimensionless.

        Args:
            pressure: Pressures p ≥ 0, shape (n,), [force / length²].

        Returns:
            Shape (n,), not negative.
        """


class ByPressure:
    """A coefficient c(p) between values at pressures, and its product with the pressure, which must not fall.

    Attributes:
        symbol: What c is called in messages.
        remedy: What to do about a product that falls.
    """

    symbol: ClassVar[str]
    remedy: ClassVar[str]
    pressure: Sequence[float]
    coefficient: Sequence[float]

    def __post_init__(self) -> None:
        """Reject incomplete tables, and products that fall."""
        name, c = type(self).__name__, self.symbol
        p, values = self._values
        require_table(name, "pressures", p, values)
        ends = values[1:] + np.diff(values) / np.diff(p) * p[1:]
        if (ends < 0).any():
            worst = int(np.argmin(ends))
            raise InvalidInputError(
                f"{c}(p) p of a {name} must not fall, got {c} = {values[worst]:g} at p = {p[worst]:g} and "
                f"{values[worst + 1]:g} at {p[worst + 1]:g}: {self.remedy}"
            )

    @property
    def _values(self) -> tuple[np.ndarray, np.ndarray]:
        return np.array(self.pressure, dtype=np.float64), np.array(self.coefficient, dtype=np.float64)

    def product(self, pressure: np.ndarray) -> np.ndarray:
        """Return c(p) p, shape (n,)."""
        return np.asarray(np.interp(pressure, *self._values) * pressure)

    def growth(self, pressure: np.ndarray) -> np.ndarray:
        """Return c + p dc/dp, the derivative of the product, shape (n,)."""
        p, c = self._values
        slope = np.concatenate([[0.0], np.diff(c) / np.diff(p), [0.0]])
        return np.asarray(np.interp(pressure, p, c) + slope[np.searchsorted(p, pressure)] * pressure)


@dataclass(frozen=True)
@checked()
class FrictionTable(ByPressure, FrictionCurve):
    """A friction coefficient that depends on the pressure: linear between values, constant beyond the ends.

    Attributes:
        pressure: Pressures p ≥ 0 by undeformed area, ascending, [force / length²].
        coefficient: The coefficient μ ≥ 0 at each of them.

    Raises:
        InvalidInputError: If the numbers do not fit each other, or μ(p) p falls anywhere.

    Example:
        >>> table = FrictionTable(pressure=(0.0, 100.0), coefficient=(0.3, 0.2))
        >>> table.strength(np.array([50.0]))  # 0.25 times 50
        array([12.5])
    """

    symbol = "μ"
    remedy = "spread its fall, or give Coulomb a shear_limit"
    pressure: Sequence[float]
    coefficient: Sequence[float]

    @property
    def largest_coefficient(self) -> float:  # type: ignore[override]
        """The largest of the coefficients."""
        return max(map(float, self.coefficient))

    def strength(self, pressure: np.ndarray) -> np.ndarray:
        """Return μ(p) p, see `FrictionCurve.strength`."""
        return self.product(pressure)


@dataclass(frozen=True)
@checked()
class SlipTable:
    """A friction coefficient that depends on the slip of a point, as from static to kinetic friction.

    Linear between values, constant beyond them. The slip is the tangential displacement that has been left
    behind over all load steps, its length and not its way.

    Attributes:
        slip: Slips ≥ 0, ascending, [length].
        coefficient: The coefficient μ ≥ 0 at each of them. Where it falls fast there may be several states.

    Raises:
        InvalidInputError: If the numbers do not fit each other.

    Example:
        >>> table = SlipTable(slip=(0.0, 0.01), coefficient=(0.3, 0.2))
        >>> table.at(np.array([0.005, 1.0]))
        array([0.25, 0.2 ])
    """

    slip: Sequence[float]
    coefficient: Sequence[float]

    def __post_init__(self) -> None:
        """Reject incomplete tables."""
        s, mu = (np.array(each, dtype=np.float64) for each in (self.slip, self.coefficient))
        require_table("SlipTable", "slips", s, mu)

    def at(self, slip: np.ndarray) -> np.ndarray:
        """Return the coefficients at slips, shape (n,).

        Args:
            slip: Lengths of slips, shape (n,), [length].
        """
        return np.asarray(np.interp(slip, self.slip, self.coefficient))

    def growth(self, slip: np.ndarray) -> np.ndarray:
        """Return the derivative of `at`, at a corner of the table that beyond it, shape (n,), [1 / length].

        Args:
            slip: Lengths of slips, shape (n,), [length].
        """
        slopes = np.diff(self.coefficient) / np.diff(self.slip)
        return np.asarray(np.pad(slopes, 1)[np.searchsorted(self.slip, slip, side="right")])


def require_table(name: str, what: str, of: np.ndarray, mu: np.ndarray) -> None:
    """Reject a table of coefficients whose numbers do not fit each other."""
    if not (
        of.ndim == 1 and of.shape == mu.shape and len(of) > 1 and of[0] >= 0 and (np.diff(of) > 0).all()
        and np.isfinite(of).all() and np.isfinite(mu).all() and (mu >= 0).all()
    ):  # fmt: skip
        raise InvalidInputError(
            f"{name} needs two or more {what} of at least zero in ascending order, and a coefficient of at "
            f"least zero for each, got {of.tolist()} and {mu.tolist()}"
        )


def require_finite(name: str, p: np.ndarray, values: Sequence[np.ndarray]) -> None:
    """Reject functions that do not return a finite number for each pressure."""
    if any(each.shape != p.shape or not np.isfinite(each).all() for each in values):
        shapes = " and ".join(str(each.shape) for each in values)
        raise InvalidInputError(
            f"{name} must return a finite number for each pressure, shape {p.shape}, got shapes {shapes}: "
            "check them at zero, low and high pressures"
        )


def rising(curve: Any, of: str, what: str, law: str, decades: int = 12) -> tuple[np.ndarray, np.ndarray]:
    """Return pressures of ``decades`` above and below one, and values of a curve there, which must not fall.

    `of`: name of the method that returns them, beside ``growth``; `what`, `law`: both in words.
    """
    p = np.concatenate([[0.0], np.logspace(-decades, decades, 40 * decades + 1)])
    name = type(curve).__name__
    with user_code(f"{name} as a law of {law}"):
        values = [np.asarray(each(p), dtype=np.float64) for each in (getattr(curve, of), curve.growth)]
    require_finite(f"{of} and growth of {name}", p, values)
    found, growth = values
    wrong = np.flatnonzero((np.diff(found) < -1e-12 * found[1:]) | (growth[1:] < 0))
    if found[0] != 0.0 or len(wrong):
        at = int(wrong[0]) + 1 if len(wrong) else 0
        raise InvalidInputError(
            f"the {what} of {name} must be zero without pressure and must not fall, got {found[at]:g} at the "
            f"pressure {p[at]:g}: keep it there for a unique answer"
        )
    return p, found


def check_rising(curve: FrictionCurve) -> None:
    """Reject a curve that falls, or starts above zero, and one with a wrong `largest_coefficient`."""
    p, strength = rising(curve, "strength", "friction traction", "friction")
    name = type(curve).__name__
    with user_code(f"{name} as a law of friction"):
        largest = float(curve.largest_coefficient)
    if (strength > largest * p * (1.0 + 1e-9)).any():
        raise InvalidInputError(
            f"largest_coefficient of {name} must be at least strength / pressure everywhere, got {largest:g} "
            f"but {np.max(strength[1:] / p[1:]):g}: give the larger one"
        )


def integral_from_zero(curve: Callable[[np.ndarray], np.ndarray], pressure: np.ndarray) -> np.ndarray:
    """Return the integral of a curve from zero to pressures, by Gauss's quadrature, shape (n,)."""
    places, weights = np.polynomial.legendre.leggauss(40)
    part = 0.5 * (places + 1.0)  # squared: curves are steep near zero
    at = [curve(np.asarray(pressure * s * s)) for s in part]
    return np.asarray(sum(w * s * c for w, s, c in zip(weights, part, at, strict=True)) * pressure)


class ClosureLaw(ABC):
    """How far two surfaces approach under pressure, for a law of your own: a rough surface, a coat, a gasket.

    Give `closure` and its derivative `growth`; use it as `ContactPair.closure`. It enters as a compliance of
    the contact points and not as a penalty: the stiffer, the closer to exact contact, at no loss of accuracy.
    Pressures are by undeformed area. The closure is zero without pressure and must not fall.

    Attributes:
        reach: Distance of the surfaces at which pressure begins and from which closures count, [length].

    Example:
        >>> class Asperities(ClosureLaw):
        ...     '''Spheres on a plane: p = (closure / 0.01)^1.5, in N/mm² and mm.'''
        ...
        ...     def closure(self, pressure):
        ...         return 0.01 * pressure ** (2 / 3)
        ...
        ...     def growth(self, pressure):
        ...         return 0.01 * 2 / 3 * pressure ** (-1 / 3)
        >>> Asperities().closure(np.array([8.0]))
        array([0.04])
    """

    reach: float = 0.0

    @abstractmethod
    def closure(self, pressure: np.ndarray) -> np.ndarray:
        """Return how far the surfaces have approached, from the distance `reach` on, [length].

        Args:
            pressure: Pressures p > 0, shape (n,), [force / length²].

        Returns:
            Shape (n,).
        """

    @abstractmethod
    def growth(self, pressure: np.ndarray) -> np.ndarray:
        """Return the derivative of `closure` by the pressure, [length³ / force].

        Args:
            pressure: Pressures p > 0, shape (n,), [force / length²].

        Returns:
            Shape (n,), not negative.
        """

    def work(self, pressure: np.ndarray) -> np.ndarray:
        """Return the integral of `closure` over the pressure from zero to p, [force / length].

        By Gauss's quadrature unless a law knows better; only energies and searches for the next step use it.

        Args:
            pressure: Pressures p > 0, shape (n,), [force / length²].

        Returns:
            Shape (n,).
        """
        return integral_from_zero(self.closure, pressure)


@dataclass(frozen=True)
@checked()
class LinearClosure(ClosureLaw):
    """Pressure proportional to the closure: p = stiffness · closure.

    Attributes:
        stiffness: Pressure per closure, > 0, [force / length³].

    Example:
        >>> LinearClosure(2000.0).closure(np.array([10.0]))
        array([0.005])
    """

    stiffness: float

    def __post_init__(self) -> None:
        """Reject a stiffness that is not positive."""
        remedy = "give the pressure per closure, or omit the closure for exact contact"
        check_positive("LinearClosure.stiffness", self.stiffness, remedy)

    def closure(self, pressure: np.ndarray) -> np.ndarray:
        """Return p / stiffness, see `ClosureLaw.closure`."""
        return np.asarray(pressure / self.stiffness)

    def growth(self, pressure: np.ndarray) -> np.ndarray:
        """Return 1 / stiffness, see `ClosureLaw.growth`."""
        return np.full(len(pressure), 1.0 / self.stiffness)

    def work(self, pressure: np.ndarray) -> np.ndarray:
        """Return p² / (2 stiffness), see `ClosureLaw.work`."""
        return np.asarray(0.5 * pressure**2 / self.stiffness)


@dataclass(frozen=True)
@checked()
class ExponentialClosure(ClosureLaw):
    """Pressure that grows exponentially as surfaces approach: p = pressure · 100^(−distance / clearance).

    It is a hundredth of ``pressure`` at the clearance, from which on there is none.

    Attributes:
        pressure: Pressure where the distance is zero, > 0, [force / length²].
        clearance: Distance at which pressure begins, > 0, [length].

    Example:
        >>> rough = ExponentialClosure(pressure=50.0, clearance=0.004)
        >>> rough.reach - rough.closure(np.array([50.0]))  # the distance under that pressure
        array([0.])
    """

    pressure: float
    clearance: float

    def __post_init__(self) -> None:
        """Reject numbers that are not positive."""
        check_positive("ExponentialClosure.pressure", self.pressure, "give that at distance zero")
        check_positive("ExponentialClosure.clearance", self.clearance, "give the distance at which it begins")

    @property
    def reach(self) -> float:  # type: ignore[override]
        """The clearance."""
        return self.clearance

    @property
    def _rate(self) -> float:
        """The distance in which pressure changes by a factor of e."""
        return float(self.clearance / np.log(100.0))

    def closure(self, pressure: np.ndarray) -> np.ndarray:
        """Return the clearance less the distance, see `ClosureLaw.closure`."""
        return self._rate * np.log(np.maximum(100.0 * pressure / self.pressure, 1.0))

    def growth(self, pressure: np.ndarray) -> np.ndarray:
        """Return the derivative of `closure`, see `ClosureLaw.growth`."""
        return np.where(100.0 * pressure > self.pressure, self._rate / np.asarray(pressure), 0.0)

    def work(self, pressure: np.ndarray) -> np.ndarray:
        """Return the integral of `closure`, see `ClosureLaw.work`."""
        begun = np.maximum(pressure, 0.01 * self.pressure)
        return np.asarray(begun * self.closure(begun) - self._rate * (begun - 0.01 * self.pressure))


@dataclass(frozen=True)
@checked()
class ClosureTable(ClosureLaw):
    """A pressure over closure that is measured: linear between values, with the last slope beyond them.

    Attributes:
        closures: Closures, ascending, [length]; a negative one is a distance, at which pressure begins.
        pressures: The pressure at each of them, ascending from zero, [force / length²].

    Raises:
        InvalidInputError: If the numbers do not fit each other, or pressures or closures fall.

    Example:
        >>> gasket = ClosureTable(closures=(0.0, 0.1, 0.15), pressures=(0.0, 5.0, 40.0))
        >>> gasket.closure(np.array([5.0, 40.0]))
        array([0.1 , 0.15])
    """

    closures: Sequence[float]
    pressures: Sequence[float]

    def __post_init__(self) -> None:
        """Reject incomplete tables, and those that fall."""
        c, p = self._values
        if not (c.ndim == 1 and c.shape == p.shape and len(c) > 1 and np.isfinite(c).all() and p[0] == 0.0):
            raise InvalidInputError(
                "ClosureTable needs two or more closures and a pressure for each, the first of them zero, "
                f"got {self.closures!r} and {self.pressures!r}"
            )
        wrong = np.flatnonzero(~((np.diff(p) > 0) & (np.diff(c) >= 0)))
        if len(wrong) or c[-1] == c[-2]:
            at = int(wrong[0]) if len(wrong) else len(c) - 2
            raise InvalidInputError(
                f"pressures of a ClosureTable must rise for a unique answer, got {p[at]:g} at {c[at]:g} and "
                f"{p[at + 1]:g} at {c[at + 1]:g}: leave out the falling part, or give it a small slope"
            )

    @property
    def _values(self) -> tuple[np.ndarray, np.ndarray]:
        """Closures and pressures."""
        values = self.closures, self.pressures
        closure, pressure = (np.array(each, dtype=np.float64) for each in values)
        return closure, pressure

    @property
    def reach(self) -> float:  # type: ignore[override]
        """The distance at which pressure begins, negative where surfaces overlap before."""
        return -float(self.closures[0])

    def _at(self, pressure: np.ndarray) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
        """Return the segment of each pressure, the slopes, and how far pressures are beyond its start."""
        c, p = self._values
        slope = np.diff(c) / np.diff(p)
        segment = np.clip(np.searchsorted(p, pressure, side="right") - 1, 0, len(slope) - 1)
        return segment, slope, pressure - p[segment]

    def closure(self, pressure: np.ndarray) -> np.ndarray:
        """Return the closure from the first value on, see `ClosureLaw.closure`."""
        c, _ = self._values
        segment, slope, beyond = self._at(pressure)
        return np.asarray(c[segment] - c[0] + slope[segment] * beyond)

    def growth(self, pressure: np.ndarray) -> np.ndarray:
        """Return the slope of the segment, see `ClosureLaw.growth`."""
        segment, slope, _ = self._at(pressure)
        return np.asarray(slope[segment])

    def work(self, pressure: np.ndarray) -> np.ndarray:
        """Return the integral of `closure`, see `ClosureLaw.work`."""
        c, p = self._values
        whole = np.concatenate([[0.0], np.cumsum(0.5 * np.diff(p) * (c[1:] + c[:-1] - 2.0 * c[0]))])
        segment, slope, beyond = self._at(pressure)
        return np.asarray(whole[segment] + beyond * (c[segment] - c[0] + 0.5 * slope[segment] * beyond))


def check_closing(law: ClosureLaw, decades: int = 12) -> None:
    """Reject a law that falls; pressures of ``decades`` above and below one."""
    p, name = np.logspace(-decades, decades, 40 * decades + 1), type(law).__name__
    with user_code(f"{name} as a law of closure"):
        closure, growth = (np.asarray(each(p), dtype=np.float64) for each in (law.closure, law.growth))
    require_finite(f"closure and growth of {name}", p, (closure, growth))
    wrong = np.flatnonzero((np.diff(closure) < -1e-12 * np.abs(closure[1:])) | (growth[1:] < 0))
    if closure[0] < 0.0 or len(wrong) or not np.isfinite(law.reach):
        at = int(wrong[0]) + 1 if len(wrong) else 0
        raise InvalidInputError(
            f"the closure of {name} must be zero without pressure and must not fall, got {closure[at]:g} at "
            f"the pressure {p[at]:g}: count from `reach`; a part with a small slope has a unique answer"
        )
