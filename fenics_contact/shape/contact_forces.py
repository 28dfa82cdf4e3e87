"""Functions of the contact forces as objectives."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from typing import Any

import numpy as np

from fenics_contact.contact import ContactResult, State
from fenics_contact.errors import InvalidInputError, together, user_code
from fenics_contact.shape.forms import ShapeForms
from fenics_contact.shape.objective import Partials
from fenics_contact.shape.sums import Weighable

#: Returns value, derivative by normal forces (n,), derivative by friction forces (n, dim − 1).
ForceFunction = Callable[[ContactResult], tuple[float, np.ndarray, np.ndarray]]


@dataclass(frozen=True)
class ContactForces(Weighable):
    """J = φ(λ_N, τ), a function of the contact forces alone, [any].

    Attributes:
        function: Takes the contact result; returns φ, ∂φ/∂λ_N of shape (n,) and ∂φ/∂τ of shape (n, dim − 1),
            the latter in the points' tangents. Must be invariant under rotation of the tangents to be smooth.

    Example:
        >>> def largest(contact):
        ...     k = int(contact.normal_force.argmax())
        ...     by_normal = np.zeros(len(contact.normal_force))
        ...     by_normal[k] = 1.0
        ...     return contact.normal_force[k], by_normal, np.zeros_like(contact.friction_force)
        >>> objective = ContactForces(largest)
    """

    function: ForceFunction

    def value(self, state: State, forms: ShapeForms) -> float:
        """Return φ. Collective."""
        with together(state.torn.decomposition.comm):
            return _finite(self._asked(state)[0])[0]

    def _asked(self, state: State) -> tuple[float, np.ndarray, np.ndarray]:
        with user_code("ContactForces.function"):
            value, normal, tangential = self.function(state.contact)
            return float(value), np.asarray(normal), np.asarray(tangential)

    def _differentiated(self, state: State) -> tuple[float, np.ndarray, np.ndarray]:
        """Return the checked result of the user's function."""
        count, width = state.torn.points.count, state.torn.dim - 1
        value, normal, tangential = self._asked(state)
        if normal.shape != (count,) or tangential.shape != (count, width):
            raise InvalidInputError(
                f"ContactForces.function must return derivatives of shapes ({count},) and ({count}, "
                f"{width}), got {normal.shape} and {tangential.shape}: one row for each contact point"
            )
        return _finite(value, normal, tangential)

    def partials(self, state: State, forms: ShapeForms) -> Partials:
        """Map the user's derivatives to the contact rows; raises as the function's call does."""
        with together(state.torn.decomposition.comm):
            value, normal, tangential = self._differentiated(state)
        return Partials.of(state, value, by_multiplier=on_rows(state, normal, tangential))


def on_rows(state: State, normal: np.ndarray | None, tangential: np.ndarray | None) -> np.ndarray:
    """Return values at the contact points in the owned rows of B, zero in all others, shape (n_owned,).

    Args:
        normal: Values for the normal rows, shape (n_points,), or None for zero.
        tangential: Values for the tangential rows, in the points' tangents, shape (n_points, dim − 1), or
            None; those of points without friction, which have no such rows, are left out.
    """
    torn = state.torn
    result = np.zeros(len(torn.numbering.owned))
    parts = []
    if normal is not None:
        parts.append((torn.normal_rows, normal))
    if tangential is not None:
        parts.append((torn.tangential_rows.ravel(), tangential[torn.frictional].ravel()))
    for rows, values in parts:
        position = state.torn.numbering.owned_index(rows)
        result[position[position >= 0]] = values[position >= 0]
    return result


def _finite(value: float, *derivatives: np.ndarray) -> tuple[Any, ...]:
    """Return the result of a function of contact forces if it is finite, else raise."""
    if not (np.isfinite(value) and all(np.isfinite(numbers).all() for numbers in derivatives)):
        raise InvalidInputError(
            "ContactForces.function must return finite numbers, got NaN or infinity: check divisions by "
            "forces that may be zero"
        )
    return value, *derivatives
