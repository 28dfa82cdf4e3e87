"""Where the slip bound of a disc comes from: given (Tresca) or the normal force (Coulomb)."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Protocol

import numpy as np

from fenics_contact.errors import InvalidInputError
from fenics_contact.qp.feasible import FeasibleSet
from fenics_contact.qp.layout import ContactLayout
from fenics_contact.qp.reductions import Vector


class SlipLaw(Protocol):
    """A rule that gives the slip bound Ψ belonging to a multiplier."""

    def bound(self, multiplier: Vector) -> Vector:
        """Return Ψ, a nodal force per friction disc, shape (n_friction,), owned."""

    @property
    def growth(self) -> Vector:
        """dΨ/dλ_N of each disc, shape (n_friction,), owned."""

    def feasible(self, multiplier: Vector) -> FeasibleSet:
        """Return Λ(Ψ) for the slip bound that belongs to the multiplier."""

    def admit(self, multiplier: Vector) -> Vector:
        """Return the nearest multiplier that the law admits with the slip bound of its own normal force."""


@dataclass(frozen=True, eq=False)
class Tresca:
    """Slip bounds that do not depend on the multiplier.

    Attributes:
        layout: Positions of the multipliers.
        slip_bound: Ψ, shape (n_friction,), owned.
    """

    layout: ContactLayout
    slip_bound: Vector

    def bound(self, multiplier: Vector) -> Vector:
        """Return the given slip bound."""
        return self.slip_bound

    @property
    def growth(self) -> Vector:
        """Zero: the bounds are given."""
        return np.zeros_like(self.slip_bound)

    def feasible(self, multiplier: Vector) -> FeasibleSet:
        """Return Λ(Ψ), the same for every multiplier."""
        return FeasibleSet(self.layout, self.slip_bound)

    def admit(self, multiplier: Vector) -> Vector:
        """Return the projection on Λ(Ψ)."""
        return self.feasible(multiplier).project(multiplier)


@dataclass(frozen=True, eq=False)
class Coulomb:
    """Slip bounds Ψ = μ max(λ_N, 0).

    Attributes:
        layout: Positions of the multipliers.
        friction_coefficient: μ per friction disc, shape (n_friction,), owned.

    Raises:
        InvalidInputError: A coefficient is negative or not finite, or their number is wrong.
    """

    layout: ContactLayout
    friction_coefficient: Vector

    def __post_init__(self) -> None:
        """Check the coefficients."""
        expected = (self.layout.n_friction,)
        given = np.asarray(self.friction_coefficient)
        if given.shape != expected:
            raise InvalidInputError(
                f"friction_coefficient must have shape {expected}, got {given.shape}: "
                "give one coefficient per friction disc"
            )
        if not np.all((given >= 0) & np.isfinite(given)):
            raise InvalidInputError(
                f"friction_coefficient must be finite and not negative, got {given.min()} to {given.max()}"
            )

    def bound(self, multiplier: Vector) -> Vector:
        """Return μ max(λ_N, 0)."""
        normal = multiplier[self.layout.tangential_frictional]
        return self.friction_coefficient * np.maximum(normal, 0.0)

    @property
    def growth(self) -> Vector:
        """The friction coefficient."""
        return self.friction_coefficient

    def feasible(self, multiplier: Vector) -> FeasibleSet:
        """Return Λ(μ λ_N)."""
        return FeasibleSet(self.layout, self.bound(multiplier))

    def admit(self, multiplier: Vector) -> Vector:
        """Return the projection on the friction cones ‖τ‖ ≤ μ λ_N, a convex set."""
        layout, mu_f = self.layout, self.friction_coefficient
        admitted = np.array(multiplier)
        admitted[layout.normal] = np.maximum(multiplier[layout.normal], 0.0)
        normal = multiplier[layout.tangential_frictional]
        tau = multiplier[layout.tangential]
        length = np.linalg.norm(tau, axis=1)
        outside = length > mu_f * normal
        peak = np.maximum((normal + mu_f * length) / (1.0 + mu_f**2), 0.0)
        shrink = np.divide(mu_f * peak, length, out=np.ones_like(length), where=outside)
        admitted[layout.tangential_frictional[outside]] = peak[outside]
        admitted[layout.tangential] = shrink[:, None] * tau
        return admitted
