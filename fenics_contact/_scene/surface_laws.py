"""Laws of surfaces: how large friction may become under pressure."""

from __future__ import annotations

from abc import ABC, abstractmethod
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from fenics_contact._base.checks import checked
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


@dataclass(frozen=True)
@checked()
class FrictionTable(FrictionCurve):
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

    pressure: Sequence[float]
    coefficient: Sequence[float]

    def __post_init__(self) -> None:
        """Reject incomplete tables, and strengths that fall."""
        p, mu = self._values
        if not (
            p.ndim == 1 and p.shape == mu.shape and len(p) > 1 and p[0] >= 0 and (np.diff(p) > 0).all()
            and np.isfinite(p).all() and np.isfinite(mu).all() and (mu >= 0).all()
        ):  # fmt: skip
            raise InvalidInputError(
                "FrictionTable needs two or more pressures of at least zero in ascending order, and a "
                f"coefficient of at least zero for each, got {self.pressure!r} and {self.coefficient!r}"
            )
        ends = mu[1:] + np.diff(mu) / np.diff(p) * p[1:]
        if (ends < 0).any():
            worst = int(np.argmin(ends))
            raise InvalidInputError(
                "the friction traction μ(p) p of a FrictionTable must not fall with the pressure, got a "
                f"coefficient that falls from {mu[worst]:g} to {mu[worst + 1]:g} between the pressures "
                f"{p[worst]:g} and {p[worst + 1]:g}: spread the fall over higher pressures, or give Coulomb "
                "a shear_limit"
            )

    @property
    def _values(self) -> tuple[np.ndarray, np.ndarray]:
        return np.array(self.pressure, dtype=np.float64), np.array(self.coefficient, dtype=np.float64)

    @property
    def largest_coefficient(self) -> float:  # type: ignore[override]
        """The largest of the coefficients."""
        return max(map(float, self.coefficient))

    def strength(self, pressure: np.ndarray) -> np.ndarray:
        """Return μ(p) p, see `FrictionCurve.strength`."""
        return np.asarray(np.interp(pressure, *self._values) * pressure)

    def growth(self, pressure: np.ndarray) -> np.ndarray:
        """Return μ + p dμ/dp, see `FrictionCurve.growth`."""
        p, mu = self._values
        slope = np.concatenate([[0.0], np.diff(mu) / np.diff(p), [0.0]])
        return np.asarray(np.interp(pressure, p, mu) + slope[np.searchsorted(p, pressure)] * pressure)


def check_rising(curve: FrictionCurve, decades: int = 12) -> None:
    """Reject a curve that falls, or starts above zero; pressures of ``decades`` above and below one."""
    p = np.concatenate([[0.0], np.logspace(-decades, decades, 40 * decades + 1)])
    name = type(curve).__name__
    with user_code(f"{name} as a law of friction"):
        values = [np.asarray(each(p), dtype=np.float64) for each in (curve.strength, curve.growth)]
        largest = float(curve.largest_coefficient)
    if any(each.shape != p.shape or not np.isfinite(each).all() for each in values):
        shapes = ", ".join(str(each.shape) for each in values)
        raise InvalidInputError(
            f"strength and growth of {name} must return a finite number for each pressure, shape {p.shape}, "
            f"got shapes {shapes}: check them at zero and at high pressures"
        )
    strength, growth = values
    wrong = np.flatnonzero((np.diff(strength) < -1e-12 * strength[1:]) | (growth[1:] < 0))
    if strength[0] != 0.0 or len(wrong):
        at = p[wrong[0] + 1] if len(wrong) else 0.0
        raise InvalidInputError(
            f"the friction traction of {name} must be zero without pressure and must not fall, got "
            f"{np.interp(at, p, strength):g} at the pressure {at:g}: a friction force that falls with the "
            "normal force has no unique answer; give it a constant value from there on"
        )
    if (strength > largest * p * (1.0 + 1e-9)).any():
        raise InvalidInputError(
            f"largest_coefficient of {name} must be at least strength / pressure everywhere, got {largest:g} "
            f"but {np.max(strength[1:] / p[1:]):g}: give the larger one"
        )
