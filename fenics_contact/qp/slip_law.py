"""Slip bounds of discs: given (Tresca) or from the normal force (Coulomb)."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Protocol

import numpy as np

from fenics_contact.errors import InvalidInputError
from fenics_contact.qp.feasible import FeasibleSet
from fenics_contact.qp.layout import ContactLayout
from fenics_contact.qp.reductions import Vector


class SlipLaw(Protocol):
    """A rule for the slip bound Ψ that belongs to a multiplier."""

    def bound(self, multiplier: Vector) -> Vector:
        """Return Ψ, a nodal force per friction disc, shape (n_friction,), owned."""

    @property
    def growth(self) -> Vector:
        """dΨ/dλ_N of each disc, shape (n_friction,), owned."""

    def feasible(self, multiplier: Vector) -> FeasibleSet:
        """Return Λ(Ψ) for the slip bound that belongs to the multiplier."""

    def admit(self, multiplier: Vector) -> Vector:
        """Return the nearest multiplier that the law admits with the slip bound of its own normal force."""

    def scaled(self, factor: Vector) -> SlipLaw:
        """Return the law for μ where λ = s μ, with the factor s of each disc, shape (n_friction,), owned."""


@dataclass(frozen=True, eq=False)
class TrescaLaw:
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
        """Zero, as the bounds are given."""
        return np.zeros_like(self.slip_bound)

    def feasible(self, multiplier: Vector) -> FeasibleSet:
        """Return Λ(Ψ), the same for every multiplier."""
        return FeasibleSet(self.layout, self.slip_bound)

    def admit(self, multiplier: Vector) -> Vector:
        """Return the projection on Λ(Ψ)."""
        return self.feasible(multiplier).project(multiplier)

    def scaled(self, factor: Vector) -> TrescaLaw:
        """Return the law with the bounds Ψ / s."""
        return TrescaLaw(self.layout, self.slip_bound / factor)


@dataclass(frozen=True, eq=False)
class CoulombLaw:
    """Slip bounds Ψ = Ψ₀ + μ max(λ_N, 0): a given part, zero by default, and one that follows λ_N.

    With both parts it is the Mohr-Coulomb law, or Tresca's on some discs and Coulomb's on others.

    Attributes:
        layout: Positions of the multipliers.
        friction_coefficient: μ per friction disc, shape (n_friction,), owned.
        given: Ψ₀ per friction disc, shape (n_friction,), owned, or one number for all, [force].

    Raises:
        InvalidInputError: A coefficient or given bound is negative or not finite, or their number is wrong.
    """

    layout: ContactLayout
    friction_coefficient: Vector
    given: Vector | float = 0.0

    def __post_init__(self) -> None:
        """Check coefficients and given bounds."""
        expected = (self.layout.n_friction,)
        coefficient = np.asarray(self.friction_coefficient)
        if coefficient.shape != expected:
            raise InvalidInputError(
                f"friction_coefficient must have shape {expected}, got {coefficient.shape}: "
                "give one coefficient per friction disc"
            )
        if not np.all((coefficient >= 0) & np.isfinite(coefficient)):
            raise InvalidInputError(
                "friction_coefficient must be finite and not negative, got "
                f"{coefficient.min()} to {coefficient.max()}"
            )
        given = np.asarray(self.given, dtype=np.float64)
        FeasibleSet(self.layout, given if given.ndim else np.full(expected, float(given)))

    def bound(self, multiplier: Vector) -> Vector:
        """Return Ψ₀ + μ max(λ_N, 0)."""
        normal = multiplier[self.layout.tangential_frictional]
        return self.given + self.friction_coefficient * np.maximum(normal, 0.0)

    @property
    def growth(self) -> Vector:
        """The friction coefficient."""
        return self.friction_coefficient

    def feasible(self, multiplier: Vector) -> FeasibleSet:
        """Return Λ(Ψ₀ + μ λ_N)."""
        return FeasibleSet(self.layout, self.bound(multiplier))

    def admit(self, multiplier: Vector) -> Vector:
        """Return the projection on the friction cones ‖τ‖ ≤ Ψ₀ + μ λ_N, λ_N ≥ 0, a convex set."""
        layout, mu_f = self.layout, self.friction_coefficient
        admitted = np.array(multiplier)
        admitted[layout.normal] = np.maximum(multiplier[layout.normal], 0.0)
        normal = multiplier[layout.tangential_frictional]
        tau = multiplier[layout.tangential]
        length = np.linalg.norm(tau, axis=1)
        outside = (length > self.given + mu_f * normal) & (length > 0.0)
        # The nearest point of the mantle; where it has no normal force, of the disc at the cone's end.
        peak = np.maximum((normal + mu_f * (length - self.given)) / (1.0 + mu_f**2), 0.0)
        shrink = np.divide(self.given + mu_f * peak, length, out=np.ones_like(length), where=outside)
        admitted[layout.tangential_frictional[outside]] = peak[outside]
        admitted[layout.tangential] = np.minimum(shrink, 1.0)[:, None] * tau
        return admitted

    def scaled(self, factor: Vector) -> CoulombLaw:
        """Return the law with the given part Ψ₀ / s; μ is unchanged, as s is that of the whole contact."""
        return CoulombLaw(self.layout, self.friction_coefficient, np.asarray(self.given / factor))
