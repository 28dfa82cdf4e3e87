"""Admissible multipliers: λ_N ≥ 0 and discs ‖τ_i‖ ≤ Ψ_i, with bounds by Tresca's or Coulomb's law."""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import Protocol

import numpy as np
import numpy.typing as npt

from fenics_contact._base.sparse import ROUNDING
from fenics_contact.errors import InvalidInputError
from fenics_contact.qp.layout import ContactLayout
from fenics_contact.qp.reductions import Vector


@dataclass(frozen=True, eq=False)
class FeasibleSet:
    """Bounds and friction discs on this rank's multipliers; no method communicates.

    All constraints are separable, so the set splits into half lines and discs, and projections, steps to
    the boundary and the split of a gradient are local to one contact.

    Attributes:
        layout: Positions of normal and tangential multipliers.
        slip_bound: Ψ, a nodal force per friction disc, shape (n_friction,), owned; 0 pins τ to zero.

    Raises:
        InvalidInputError: A slip bound is negative or not finite, or their number is wrong.

    References:
        Z. Dostál, T. Kozubek, An optimal algorithm and superrelaxation for minimization of a quadratic
        function subject to separable convex constraints with applications, Math. Program. 135 (2012).
    """

    layout: ContactLayout
    slip_bound: Vector

    def __post_init__(self) -> None:
        """Check the slip bound."""
        expected = (self.layout.n_friction,)
        if np.shape(self.slip_bound) != expected:
            raise InvalidInputError(f"slip_bound must have shape {expected}, got {np.shape(self.slip_bound)}")
        if not np.all((self.slip_bound >= 0) & np.isfinite(self.slip_bound)):
            raise InvalidInputError(
                f"slip_bound must be in [0, ∞), got {np.min(self.slip_bound)} to {np.max(self.slip_bound)}"
            )

    def project(self, x: Vector) -> Vector:
        """Return the nearest admissible multiplier, owned."""
        projected = np.array(x, dtype=np.float64)
        normal, rows = self.layout.normal, self.layout.tangential
        projected[normal] = np.maximum(x[normal], 0.0)
        tau = x[rows]
        length = np.linalg.norm(tau, axis=1)
        outside = length > self.slip_bound
        shrink = self.slip_bound[outside] / length[outside]
        projected[rows[outside]] = shrink[:, None] * tau[outside]
        return projected

    def violation(self, x: Vector) -> float:
        """Return the largest distance of a normal multiplier or disc of this rank to its bound."""
        normal = -x[self.layout.normal]
        tangential = np.linalg.norm(x[self.layout.tangential], axis=1) - self.slip_bound
        return max(normal.max(initial=0.0), tangential.max(initial=0.0))

    def active(self, x: Vector) -> npt.NDArray[np.bool_]:
        """Mark the entries whose constraint holds with equality, shape (size,), owned."""
        marks = np.zeros(self.layout.size, dtype=bool)
        marks[self.layout.normal] = x[self.layout.normal] <= 0.0
        marks[self.layout.tangential[self._on_circle(x)]] = True
        return marks

    def projected_gradient(self, x: Vector, gradient: Vector) -> Vector:
        """Return the gradient without its components against active constraints, owned.

        Where a constraint with outward normal n is active and −g points out of the set, that part of g is
        removed: gᴾ = g − min(nᵀg, 0) n. Zero exactly at a minimiser over the set.
        """
        result = np.array(gradient)
        normal, rows = self.layout.normal, self.layout.tangential
        closed_off = normal[x[normal] <= 0.0]
        result[closed_off] = np.minimum(gradient[closed_off], 0.0)
        circle = self._on_circle(x)
        outward = _unit(x[rows[circle]])
        push = np.minimum(np.einsum("ia,ia->i", outward, gradient[rows[circle]]), 0.0)
        result[rows[circle]] -= push[:, None] * outward
        result[rows[self.slip_bound <= 0.0]] = 0.0
        return result

    def step_to_boundary(self, x: Vector, direction: Vector) -> float:
        """Return the largest step a ≥ 0 with x − a·direction in the set, infinite if there is no boundary.

        For a disc it is the larger root of ‖τ − a p‖² = Ψ², written without cancellation.
        """
        p, value = direction[self.layout.normal], x[self.layout.normal]
        falling = p > 0.0
        with np.errstate(over="ignore"):  # an overflow means no boundary
            steps = np.maximum(value[falling], 0.0) / p[falling]
        return float(min(steps.min(initial=np.inf), self._disc_steps(x, direction).min(initial=np.inf)))

    def pressed(self, multiplier: Vector, residual: Vector) -> float:
        """Return Σ λ_N r⁺, the work of normal forces that act across a gap, [force · length]."""
        normal = self.layout.normal
        return float(multiplier[normal] @ np.maximum(residual[normal], 0.0))

    def rubbed(self, tau: Vector, slid: Vector) -> float:
        """Return Σ Ψ‖s‖ − τ·s, the deficit of the dissipation by friction forces, [force · length].

        As (Ψ − ‖τ‖)‖s‖ + ½‖τ‖‖s‖‖ŝ − τ̂‖², which is free of cancellation where force and slip are parallel.
        """
        force, way = np.linalg.norm(tau, axis=1), np.linalg.norm(slid, axis=1)
        short = self.slip_bound - force
        short[short <= ROUNDING * self.slip_bound] = 0.0
        turned = (
            slid / np.where(way > 0.0, way, 1.0)[:, None] - tau / np.where(force > 0.0, force, 1.0)[:, None]
        )
        return float((way * (short + 0.5 * force * np.einsum("ia,ia->i", turned, turned))).sum())

    def _disc_steps(self, x: Vector, direction: Vector) -> Vector:
        p, tau = direction[self.layout.tangential], x[self.layout.tangential]
        square = np.einsum("ia,ia->i", p, p)
        moving = square > 0.0
        square, p, tau = square[moving], p[moving], tau[moving]
        length = np.linalg.norm(tau, axis=1)
        radius = self.slip_bound[moving]
        slope = np.einsum("ia,ia->i", tau, p)
        room = np.maximum((radius - length) * (radius + length), 0.0)
        root = np.sqrt(slope**2 + square * room)
        forward = slope > 0.0
        steps = np.empty_like(root)
        steps[forward] = (slope + root)[forward] / square[forward]
        backward = (root - slope)[~forward]
        steps[~forward] = np.divide(
            room[~forward], backward, out=np.zeros_like(backward), where=backward > 0.0
        )
        return steps

    def _on_circle(self, x: Vector) -> npt.NDArray[np.bool_]:
        length = np.linalg.norm(x[self.layout.tangential], axis=1)
        return length >= self.slip_bound * (1.0 - ROUNDING)


def _unit(vectors: Vector) -> Vector:
    """Return the rows scaled to unit length; rows of zeros stay zero."""
    length = np.linalg.norm(vectors, axis=1, keepdims=True)
    return np.divide(vectors, length, out=np.zeros_like(vectors), where=length > 0.0)


class SlipLaw(Protocol):
    """A rule for the slip bound Ψ that belongs to a multiplier."""

    def bound(self, multiplier: Vector) -> Vector:
        """Return Ψ, a nodal force per friction disc, shape (n_friction,), owned."""

    @property
    def grows(self) -> bool:
        """Whether the bound of some disc of this rank follows its normal force."""

    def growth(self, multiplier: Vector) -> Vector:
        """Return dΨ/dλ_N ≥ 0 of each disc, shape (n_friction,), owned."""

    def feasible(self, multiplier: Vector) -> FeasibleSet:
        """Return Λ(Ψ) for the slip bound that belongs to the multiplier."""

    def admit(self, multiplier: Vector) -> Vector:
        """Return the nearest multiplier that the law admits with the slip bound of its own normal force.

        Where these are no convex set, that of the smallest convex cones that contain it.
        """

    def scaled(self, factor: Vector) -> SlipLaw:
        """Return the law for μ where λ = s μ, with the factor s of each disc, shape (n_friction,), owned."""


@dataclass(frozen=True, eq=False)
class TrescaLaw:
    """Slip bounds that do not depend on the multiplier."""

    layout: ContactLayout
    slip_bound: Vector

    def bound(self, multiplier: Vector) -> Vector:
        """Return the given slip bound."""
        return self.slip_bound

    @property
    def grows(self) -> bool:
        """False, as the bounds are given."""
        return False

    def growth(self, multiplier: Vector) -> Vector:
        """Return zeros."""
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


class StrengthCurve(Protocol):
    """The largest friction traction as a function of the pressure, which never falls."""

    def strength(self, pressure: Vector) -> Vector:
        """Return the traction, shape (n,), [force / area]; zero without pressure."""

    def growth(self, pressure: Vector) -> Vector:
        """Return its derivative, shape (n,)."""


@dataclass(frozen=True, eq=False)
class Proportional:
    """Ψ(λ_N) = μ λ_N of friction discs.

    `coefficient`: μ.
    """

    coefficient: Vector

    def part(self, chosen: npt.NDArray[np.int64]) -> Proportional:
        """Return those of some discs."""
        return Proportional(self.coefficient[chosen])

    def scaled(self, factor: Vector) -> Proportional:
        """Return the bounds Ψ(s μ) / s of scaled normal forces."""
        return self

    def bound(self, normal: Vector) -> Vector:
        """Return Ψ at normal forces λ_N, shape (n,), [force]."""
        return np.asarray(self.coefficient * np.maximum(normal, 0.0))

    def growth(self, normal: Vector) -> Vector:
        """Return dΨ/dλ_N, shape (n,)."""
        return self.coefficient

    def limited(self, normal: Vector) -> npt.NDArray[np.bool_]:
        """Return which discs are at a limit, shape (n,)."""
        return np.zeros(len(normal), dtype=bool)

    def by_area(self, normal: Vector) -> Vector:
        """Return dΨ/dA at given normal forces, shape (n,)."""
        return np.zeros(len(normal))

    def outside(self, normal: Vector, given: Vector | float, length: Vector) -> npt.NDArray[np.bool_]:
        """Return which friction forces are outside the cone ‖τ‖ ≤ Ψ₀ + μ λ_N, shape (n,)."""
        return np.asarray(length > given + self.coefficient * normal)

    def nearest(self, normal: Vector, peak: Vector) -> tuple[Vector, Vector]:
        """Return the normal force of the nearest point, from that on the mantle, and Ψ there, (n,) each."""
        return peak, self.coefficient * peak


@dataclass(frozen=True, eq=False)
class Strengths(Proportional):
    """Ψ(λ_N) = min(h(λ_N), Ψ_max) of friction discs, with h = μ λ_N or h = A t(λ_N / A).

    `coefficient`: μ; where there is a curve the least one with t(p) ≤ μ p; `limit`: Ψ_max; infinite where
    there is none; `area`: A; `curve`: number of the curve t, −1 where there is none.
    """

    limit: Vector
    area: Vector
    curve: npt.NDArray[np.int64]
    curves: tuple[StrengthCurve, ...] = ()

    def part(self, chosen: npt.NDArray[np.int64]) -> Strengths:
        """Return those of some discs."""
        return replace(
            self,
            coefficient=self.coefficient[chosen],
            limit=self.limit[chosen],
            area=self.area[chosen],
            curve=self.curve[chosen],
        )

    def scaled(self, factor: Vector) -> Strengths:
        """Return the bounds Ψ(s μ) / s of scaled normal forces."""
        return replace(self, limit=self.limit / factor, area=self.area / factor)

    def bound(self, normal: Vector) -> Vector:
        """Return Ψ at normal forces λ_N, shape (n,), [force]."""
        return np.minimum(self._rough(normal)[0], self.limit)

    def growth(self, normal: Vector) -> Vector:
        """Return dΨ/dλ_N, zero at the limit, shape (n,)."""
        bound, growth = self._rough(normal)
        return np.where(bound < self.limit, growth, 0.0)

    def limited(self, normal: Vector) -> npt.NDArray[np.bool_]:
        """Return which discs are at their limit, shape (n,)."""
        return np.asarray(self._rough(normal)[0] >= self.limit)

    def by_area(self, normal: Vector) -> Vector:
        """Return dΨ/dA at given normal forces, shape (n,); limits are proportional to areas."""
        bound, growth = self._rough(normal)
        limited = bound >= self.limit
        force = np.where(limited, self.limit, bound - growth * np.maximum(normal, 0.0))
        return np.where((self.curve >= 0) | limited, force / np.where(self.area > 0.0, self.area, 1.0), 0.0)

    def outside(self, normal: Vector, given: Vector | float, length: Vector) -> npt.NDArray[np.bool_]:
        """Return which friction forces are outside the cone, or beyond the limit, shape (n,)."""
        return super().outside(normal, given, length) | (length > given + self.limit)

    def nearest(self, normal: Vector, peak: Vector) -> tuple[Vector, Vector]:
        """Return the normal force of the nearest point and Ψ there, shape (n,) each.

        Cones end in cylinders: beyond their edge the normal force stays, or is that of the edge.
        """
        mu_f = self.coefficient
        edge = np.divide(self.limit, mu_f, out=np.full_like(mu_f, np.inf), where=mu_f > 0.0)
        peak = np.where(peak > edge, np.maximum(normal, edge), peak)
        return peak, np.minimum(mu_f * peak, self.limit)

    def _rough(self, normal: Vector) -> tuple[Vector, Vector]:
        """Return h and dh/dλ_N."""
        force = np.maximum(normal, 0.0)
        bound, growth = self.coefficient * force, self.coefficient.copy()
        for number, curve in enumerate(self.curves):
            mine = self.curve == number
            pressure = force[mine] / self.area[mine]
            bound[mine], growth[mine] = self.area[mine] * curve.strength(pressure), curve.growth(pressure)
        return bound, growth


@dataclass(frozen=True, eq=False)
class CoulombLaw:
    """Slip bounds Ψ = Ψ₀ + h(λ_N): a given part, zero by default, and one that follows λ_N.

    With both parts it is the Mohr-Coulomb law, or Tresca's on some discs and Coulomb's on others.
    `strength`: h, owned; `given`: Ψ₀ per friction disc, owned, or one number for all.
    """

    layout: ContactLayout
    strength: Proportional
    given: Vector | float = 0.0

    def __post_init__(self) -> None:
        """Check coefficients and given bounds."""
        expected = (self.layout.n_friction,)
        coefficient = np.asarray(self.strength.coefficient)
        if coefficient.shape != expected:
            raise InvalidInputError(f"friction_coefficient needs shape {expected}, got {coefficient.shape}")
        if not np.all((coefficient >= 0) & np.isfinite(coefficient)):
            raise InvalidInputError(
                f"friction_coefficient must be in [0, ∞), got {coefficient.min()} to {coefficient.max()}"
            )
        given = np.asarray(self.given, dtype=np.float64)
        FeasibleSet(self.layout, given if given.ndim else np.full(expected, float(given)))

    def bound(self, multiplier: Vector) -> Vector:
        """Return Ψ₀ + h(λ_N)."""
        return self.given + self.strength.bound(multiplier[self.layout.tangential_frictional])

    @property
    def grows(self) -> bool:
        """Whether any coefficient is positive."""
        return bool(np.any(self.strength.coefficient > 0.0))

    def growth(self, multiplier: Vector) -> Vector:
        """Return the friction coefficient, or the slope of the curve; zero at a limit."""
        return self.strength.growth(multiplier[self.layout.tangential_frictional])

    def feasible(self, multiplier: Vector) -> FeasibleSet:
        """Return Λ(Ψ₀ + μ λ_N)."""
        return FeasibleSet(self.layout, self.bound(multiplier))

    def admit(self, multiplier: Vector) -> Vector:
        """Return the projection on the friction cones ‖τ‖ ≤ Ψ₀ + μ λ_N, λ_N ≥ 0, a convex set."""
        layout, mu_f = self.layout, self.strength.coefficient
        admitted = np.array(multiplier)
        admitted[layout.normal] = np.maximum(multiplier[layout.normal], 0.0)
        normal = multiplier[layout.tangential_frictional]
        tau = multiplier[layout.tangential]
        length = np.linalg.norm(tau, axis=1)
        outside = self.strength.outside(normal, self.given, length) & (length > 0.0)
        # The nearest point of the mantle; where it has no normal force, of the disc at the cone's end.
        peak = np.maximum((normal + mu_f * (length - self.given)) / (1.0 + mu_f**2), 0.0)
        peak, bound = self.strength.nearest(normal, peak)
        shrink = np.divide(self.given + bound, length, out=np.ones_like(length), where=outside)
        admitted[layout.tangential_frictional[outside]] = peak[outside]
        admitted[layout.tangential] = np.minimum(shrink, 1.0)[:, None] * tau
        return admitted

    def scaled(self, factor: Vector) -> CoulombLaw:
        """Return the law with the given part Ψ₀ / s; μ is unchanged, as s is that of the whole contact."""
        return CoulombLaw(self.layout, self.strength.scaled(factor), np.asarray(self.given / factor))
