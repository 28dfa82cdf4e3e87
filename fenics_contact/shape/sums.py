"""Sums, multiples and the largest of objectives."""

from __future__ import annotations

from dataclasses import dataclass, fields
from typing import Any, cast

import numpy as np

from fenics_contact.contact import State
from fenics_contact.errors import InvalidInputError
from fenics_contact.shape.forms import ShapeForms
from fenics_contact.shape.objective import Objective, Partials


class Weighable:
    """An objective that can be added to others and scaled: ``TotalPotential() + 2.0 * penalty``."""

    #: NumPy's numbers leave products to this class.
    __array_ufunc__ = None

    def __mul__(self, weight: float) -> WeightedSum:
        """Return the objective times a number."""
        return WeightedSum(((weight, cast(Objective, self)),))

    __rmul__ = __mul__

    def __add__(self, other: Objective) -> WeightedSum:
        """Return the sum of two objectives."""
        return WeightedSum((*_terms(self), *_terms(other)))

    def __radd__(self, other: Objective) -> WeightedSum:
        """Return the sum with an objective that defines no sum itself."""
        return WeightedSum((*_terms(other), *_terms(self)))

    def __neg__(self) -> WeightedSum:
        """Return the objective with the other sign."""
        return -1.0 * self

    def __sub__(self, other: Objective) -> WeightedSum:
        """Return the difference of two objectives."""
        return self + -1.0 * WeightedSum(_terms(other))


@dataclass(frozen=True)
class WeightedSum(Weighable):
    """J = Σ w_k J_k, what sums and multiples of objectives are.

    Attributes:
        terms: Weights w_k and objectives J_k, at least one.

    Raises:
        InvalidInputError: If there is no term, a weight is no finite number, or a term no objective.

    Example:
        >>> from fenics_contact.shape import TotalPotential, VolumeIntegral
        >>> light = TotalPotential() + 2.0 * VolumeIntegral("area", lambda u, x, stress: u[0] ** 2, "link")
        >>> [weight for weight, _ in light.terms]
        [1.0, 2.0]
    """

    terms: tuple[tuple[float, Objective], ...]

    def __post_init__(self) -> None:
        """Check weights and objectives."""
        if not self.terms:
            raise InvalidInputError("WeightedSum needs a term, got none: give (weight, objective)")
        for weight, objective in self.terms:
            if not isinstance(weight, int | float | np.number) or not np.isfinite(weight):
                raise InvalidInputError(
                    f"an objective can be multiplied by a finite number, got {weight!r}: give its weight, "
                    "such as 2.0 * objective"
                )
            if not callable(getattr(objective, "partials", None)):
                raise InvalidInputError(
                    f"an objective can be added to another one, got {type(objective).__name__}: add an "
                    "object with value and partials, such as TotalPotential()"
                )

    def __mul__(self, weight: float) -> WeightedSum:
        """Return the sum times a number."""
        return WeightedSum(tuple((weight * own, objective) for own, objective in self.terms))

    __rmul__ = __mul__

    def value(self, state: State, forms: ShapeForms) -> float:
        """Return the sum alone. Collective."""
        return float(sum(weight * objective.value(state, forms) for weight, objective in self.terms))

    def partials(self, state: State, forms: ShapeForms) -> Partials:
        """Add the partial derivatives. Collective."""
        parts = [(weight, objective.partials(state, forms)) for weight, objective in self.terms]

        def total(name: str) -> Any:
            terms = [weight * values for weight, part in parts if (values := getattr(part, name)) is not None]
            return sum(terms) if terms else None

        return Partials(*(total(each.name) for each in fields(Partials)))


def _terms(objective: Any) -> tuple[tuple[float, Objective], ...]:
    return objective.terms if isinstance(objective, WeightedSum) else ((1.0, objective),)


@dataclass(frozen=True)
class Maximum(Weighable):
    """J = max J_k, such as the largest stress of several bodies; scale objectives of different units.

    The subgradient is that of the largest, of the first one where several are equal. A bundle method joins
    those of both sides of such a kink.

    Attributes:
        objectives: J_k, at least one.

    Raises:
        InvalidInputError: If there is none, or one is no objective.

    Example:
        >>> from fenics_contact.shape import LargestPressure
        >>> len(Maximum((LargestPressure(0), LargestPressure(1))).objectives)
        2
    """

    objectives: tuple[Objective, ...]

    def __post_init__(self) -> None:
        """Check the objectives; any sequence becomes a tuple."""
        given = self.objectives
        if not isinstance(given, list | tuple) or not given:
            raise InvalidInputError(
                f"Maximum needs a tuple of objectives, got {given!r}: write Maximum((first, second))"
            )
        for objective in given:
            if not callable(getattr(objective, "partials", None)):
                raise InvalidInputError(
                    f"Maximum needs objectives, got {type(objective).__name__}: give objects with value and "
                    "partials, such as LargestPressure()"
                )
        object.__setattr__(self, "objectives", tuple(given))

    def value(self, state: State, forms: ShapeForms) -> float:
        """Return the largest value. Collective."""
        return self._active(state, forms)[0]

    def partials(self, state: State, forms: ShapeForms) -> Partials:
        """Differentiate the largest one. Collective."""
        return self._active(state, forms)[1].partials(state, forms)

    def _active(self, state: State, forms: ShapeForms) -> tuple[float, Objective]:
        """Return the largest value and its objective, the same on all ranks. Collective."""
        values = [objective.value(state, forms) for objective in self.objectives]
        value, place = state.torn.decomposition.comm.bcast((max(values), int(np.argmax(values))))
        return float(value), self.objectives[place]
