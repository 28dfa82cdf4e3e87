"""The set Λ(Ψ) of admissible multipliers: λ_N ≥ 0 and ‖τ_i‖ ≤ Ψ_i, one disc per frictional contact."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
import numpy.typing as npt

from fenics_contact.errors import InvalidInputError
from fenics_contact.linalg import ROUNDING
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
            raise InvalidInputError(
                f"slip_bound must have shape {expected}, got {np.shape(self.slip_bound)}: "
                "give one nodal force per friction disc"
            )
        if not np.all((self.slip_bound >= 0) & np.isfinite(self.slip_bound)):
            raise InvalidInputError(
                f"slip_bound must be finite and not negative, got {np.min(self.slip_bound)} to "
                f"{np.max(self.slip_bound)}: check the friction coefficient and the normal forces"
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
