"""The largest stress of a body as an objective, smoothed."""

from __future__ import annotations

from dataclasses import dataclass

import ufl
from ufl.core.expr import Expr

from fenics_contact.checks import checked
from fenics_contact.contact import State
from fenics_contact.shape.forms import Density, ShapeForms
from fenics_contact.shape.objective import Partials, require_linear
from fenics_contact.shape.pressures import require_exponent
from fenics_contact.shape.sums import Weighable
from fenics_contact.shape.volume_integral import BodyIntegral, require_body


@dataclass(frozen=True)
@checked()
class LargestStress(Weighable):
    """J = (∫ σ^p dx / V)^(1/p), σ the von Mises stress, a smooth bound of its largest, [force / length²].

    J lies below the largest stress in the points of quadrature. Where that stress σ_max prevails in a volume
    V_c, such as that of a cell,

        J ≤ σ_max ≤ J (V / V_c)^(1/p):

    a peak in a thousandth of the body is at most 2.4 J with p = 8, 1.4 J with p = 20. The larger p, the
    closer, and the more J behaves like the maximum with its kinks. `largest` tells how far off it is. Thermal
    stress counts.

    Attributes:
        body: Name of the body.
        p: Exponent from 2 to 100: below, J has kinks where nothing is stressed.

    Raises:
        InvalidInputError: If p is out of its range.

    Example:
        >>> LargestStress("link 1", p=12.0).body
        'link 1'
    """

    body: str
    p: float = 8.0

    def __post_init__(self) -> None:
        """Check the exponent."""
        require_exponent("LargestStress", self.p)

    def largest(self, state: State) -> float:
        """Return the largest mean of the von Mises stress over a cell, not smoothed. Collective.

        Raises:
            InvalidInputError: If there is no such body.
        """
        require_body(state, "LargestStress", self.body)
        return float(state.gather_von_mises(self.body).max())

    def value(self, state: State, forms: ShapeForms) -> float:
        """Return the smoothed stress. Collective; raises as `largest` does."""
        return self._evaluated(state, forms)[0]

    def partials(self, state: State, forms: ShapeForms) -> Partials:
        """Differentiate by UFL. Collective; raises as `largest` does."""
        value, stressed, volume, numbers = self._evaluated(state, forms)
        if value == 0.0:
            return Partials.of(state, 0.0)
        # δJ = J/p (δI/I − δV/V): a single integral with these factors.
        by_powers, by_volume = value / (self.p * stressed), value / (self.p * volume)
        integral = BodyIntegral(state, forms, _DENSITY, self.body)
        return Partials.of(state, value, **integral.derivatives(*numbers, by_powers, -by_volume))

    def _evaluated(self, state: State, forms: ShapeForms) -> tuple[float, float, float, tuple[float, float]]:
        """Return J, I = ∫ (σ/σ_r)^p dx, the volume, and the constants 1/σ_r² and p/2. Collective.

        Any σ_r gives the same J. That of a smaller p is near enough to the largest stress, whatever the unit,
        for powers not to overflow: first the root mean square, then that of 16.
        """
        require_linear(state, self)
        require_body(state, "LargestStress", self.body)
        integral = BodyIntegral(state, forms, _DENSITY, self.body)
        volume, value = integral(0.0, 1.0, 0.0, 1.0), 1.0
        for p in (2.0, min(self.p, 16.0), self.p):
            numbers = (value**-2.0, 0.5 * p)
            stressed = integral(*numbers, 1.0, 0.0)
            value *= (stressed / volume) ** (1.0 / p)
            if value == 0.0:
                break
        return value, stressed, volume, numbers


def _powers(u: Expr, x: Expr, stress: Expr, *numbers: Expr) -> Expr:
    """Return a (σ²/σ_r²)^(p/2) + b."""
    scale, half, by_powers, by_volume = numbers
    deviator = stress - ufl.tr(stress) / 3 * ufl.Identity(3)
    return by_powers * (1.5 * scale * ufl.inner(deviator, deviator)) ** half + by_volume


_DENSITY = Density("powers of the von Mises stress", _powers, constants=4, in_space=True)
