"""Means of stress and displacement near a place, which meshes of all sizes have in common."""

from __future__ import annotations

from abc import ABC, abstractmethod
from collections.abc import Callable
from dataclasses import dataclass
from typing import Any

import numpy as np
import ufl
from ufl.core.expr import Expr

from fenics_contact._base.checks import GivenVector, checked, unit_vector
from fenics_contact.design.forms import Density, ShapeForms
from fenics_contact.design.motion import BodyIntegral, require_body
from fenics_contact.design.objective import Partials, Weighable, require_linear
from fenics_contact.errors import InvalidInputError
from fenics_contact.results.state import State


@dataclass(frozen=True)
@checked()
class MeanNear(Weighable, ABC):
    """J = ∫ w f dx / ∫ w dx with the weight w = (1 − |x − x₀|² / R²)² within the radius R, zero beyond.

    A value in a point has no derivative that a mesh resolves, and at a corner no limit: a mean over a given
    radius has both. `at`: x₀, in the body or on its surface; `radius`: R; two or more cells.
    """

    can_be_infinite = False

    body: str
    at: GivenVector
    radius: float

    def __post_init__(self) -> None:
        """Check the radius."""
        if not 0.0 < self.radius < np.inf:
            raise InvalidInputError(
                f"{type(self).__name__}.radius must be a positive length, got {self.radius!r}: give two cells"
            )

    @abstractmethod
    def _density(self, state: State) -> tuple[Density, tuple[float, ...]]:
        """Return a weighted integrand, and the values of its further constants."""

    def value(self, state: State, forms: ShapeForms) -> float:
        """Return the mean. Collective.

        Raises:
            InvalidInputError: If there is no such body, the place has other dimensions, or no cell of the
                body lies within the radius.
        """
        return self._evaluated(state, forms)[0]

    def partials(self, state: State, forms: ShapeForms) -> Partials:
        """Differentiate by UFL. Collective; raises as `value` does."""
        value, weight, integral, numbers = self._evaluated(state, forms)
        # δJ = (δ∫ w f − J δ∫ w) / ∫ w: a single integral with these factors.
        derivatives = integral.derivatives(*numbers, 1.0 / weight, -value / weight)
        return Partials.of(state, value, **derivatives)

    def _evaluated(
        self, state: State, forms: ShapeForms
    ) -> tuple[float, float, BodyIntegral, tuple[float, ...]]:
        """Return J, ∫ w dx, the integral, and its constants but the two factors. Collective."""
        name, place = type(self).__name__, np.array(self.at, dtype=float)
        require_linear(state, self)
        require_body(state, name, self.body)
        if place.shape != (state.scene.dim,):
            raise InvalidInputError(
                f"{name}.at must be a place of {state.scene.dim} coordinates in the body, got {self.at!r}"
            )
        density, further = self._density(state)
        integral = BodyIntegral(state, forms, density, self.body)
        numbers = (*place, self.radius, *further)
        weight = integral(*numbers, 0.0, 1.0)
        if weight <= 0.0:
            raise InvalidInputError(
                f"{name} needs cells of body {self.body!r} within {self.radius:g} of its place, got none at "
                f"{tuple(map(float, place))}: give a place in the body, or a larger radius"
            )
        return integral(*numbers, 1.0, 0.0) / weight, weight, integral, numbers


def _weighted(
    what: Callable[..., Expr], name: str, dim: int, further: int = 0, *, degree: int = 6
) -> Density:
    """Return the density a w f + b w; f takes displacement, stress and further constants.

    `further`: how many; `degree`: of the quadrature, as w varies within a cell.
    """

    def integrand(u: Expr, x: Expr, stress: Expr, *numbers: Expr) -> Expr:
        at = numbers[:dim]
        radius, *more, by_mean, by_weight = numbers[dim:]
        square = sum((x[k] - at[k]) ** 2 for k in range(dim)) / radius**2
        weight = ufl.max_value(1.0 - square, 0.0) ** 2
        return by_mean * weight * what(u, stress, *more) + by_weight * weight

    return Density(f"{name} near a place", integrand, dim + 3 + further, in_space=not further, degree=degree)


def _von_mises(u: Expr, stress: Expr) -> Expr:
    deviator = stress - ufl.tr(stress) / 3 * ufl.Identity(3)
    return ufl.sqrt(1.5 * ufl.inner(deviator, deviator))


def _component(i: int, j: int) -> Callable[..., Expr]:
    return lambda u, stress: stress[i, j]


def _along(u: Expr, stress: Expr, *direction: Expr) -> Expr:
    return sum(direction[k] * u[k] for k in range(len(direction)))


_STRESSES: dict[str, Callable[..., Any]] = {"von_mises": _von_mises}
_STRESSES |= {a + b: _component("xyz".index(a), "xyz".index(b)) for a in "xyz" for b in "xyz" if a <= b}
#: By the number of dimensions; what is compiled once is found again by these.
_OF_STRESS = {(name, dim): _weighted(what, name, dim) for name, what in _STRESSES.items() for dim in (2, 3)}
_OF_MOVEMENT = {dim: _weighted(_along, "displacement", dim, dim) for dim in (2, 3)}


@dataclass(frozen=True)
@checked()
class StressNear(MeanNear):
    """J = ∫ w σ dx / ∫ w dx, the mean of a stress near a place, weighted by `MeanNear`, [force / length²].

    Attributes:
        component: ``"von_mises"``, or a component "xx", "xy", ... of the stress tensor; of plane bodies "zz"
            is that normal to the plane. Thermal stress counts.

    Raises:
        InvalidInputError: If the radius is not positive, or there is no such component.

    Example:
        >>> StressNear("block", (0.0, 0.5), radius=0.1, component="xx").component
        'xx'
    """

    component: str = "von_mises"

    def __post_init__(self) -> None:
        """Check radius and component."""
        super().__post_init__()
        if self.component not in _STRESSES:
            raise InvalidInputError(
                f"StressNear.component must be one of {sorted(_STRESSES)}, got {self.component!r}"
            )

    def _density(self, state: State) -> tuple[Density, tuple[float, ...]]:
        return _OF_STRESS[self.component, state.scene.dim], ()


@dataclass(frozen=True, kw_only=True)
@checked()
class MovementNear(MeanNear):
    """J = d · ∫ w u dx / ∫ w dx, the mean displacement near a place, weighted by `MeanNear`, [length].

    Attributes:
        direction: d, of any length: it is divided by it.

    Example:
        >>> MovementNear("block", (0.0, 0.5), radius=0.1, direction=(1, 0)).direction
        (1, 0)
    """

    direction: GivenVector

    def _density(self, state: State) -> tuple[Density, tuple[float, ...]]:
        direction = unit_vector("MovementNear.direction", self.direction, state.scene.dim)
        return _OF_MOVEMENT[state.scene.dim], tuple(map(float, direction))
