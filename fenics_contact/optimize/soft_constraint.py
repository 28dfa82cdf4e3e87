"""Cutting planes of a nonlinear constraint whose violation costs a penalty."""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from fenics_contact.optimize.bundle import Bundle, Plane

Array = NDArray[np.float64]


@dataclass(frozen=True)
class Rise:
    """What a trial point says of a penalty ρ max(c, 0), units of J.

    Attributes:
        change: Its change from the centre to the trial point.
        slope: ρ a·y where c > 0 at the trial point, else 0, with the subgradient a there.
        predicted: Its change at the trial point as the new plane predicts it.
    """

    change: float = 0.0
    slope: float = 0.0
    predicted: float = 0.0


@dataclass(frozen=True)
class SoftConstraint:
    """c(x) ≤ 0 as ρ max(c(x), 0) in the merit function, and as rows with a slack in the step's programme.

    Attributes:
        bundle: Cutting planes of c at the centre, with their own linearisation errors.
        value: c at the centre, divided by the size of the constraint.
        penalty: ρ, units of J.
        first_penalty: ρ at the start.
    """

    bundle: Bundle
    value: float
    penalty: float
    first_penalty: float

    @property
    def violation(self) -> float:
        """max(c, 0) at the centre."""
        return max(self.value, 0.0)

    @property
    def gradients(self) -> Array:
        """ρ a_i, shape (m, n)."""
        return self.penalty * self.bundle.gradients

    @property
    def depths(self) -> Array:
        """ρ (β_i - c), by which the planes lie below the limit at the centre, shape (m,)."""
        return self.penalty * (self.bundle.measures - self.value)

    @property
    def dearest(self) -> bool:
        """Whether the penalty is as large as it may be."""
        return self.penalty >= 0.999 * self._most

    @property
    def _most(self) -> float:
        return 1e6 * self.first_penalty

    def predicted(self, move: Array) -> float:
        """Return the violation that the planes predict for a move of shape (n,)."""
        return max(self.value + self.bundle.model(move), 0.0)

    def raised(self, factor: float) -> SoftConstraint:
        """Return the constraint with a larger penalty."""
        return replace(self, penalty=min(factor * self.penalty, self._most))

    def with_cut(self, plane: Plane, move: Array) -> tuple[SoftConstraint, Rise]:
        """Return the constraint with the plane of a trial point at the end, and what the point says.

        Args:
            move: The step to it, shape (n,), scaled variables.
        """
        value, slope = plane.value, float(plane.gradient @ move)
        error, length = slope - (value - self.value), float(np.linalg.norm(move))
        bundle = self.bundle.with_cut(plane, error, length)
        seen = max(self.value + slope - float(bundle.measures[-1]), 0.0)
        return replace(self, bundle=bundle), Rise(
            self.penalty * (max(value, 0.0) - self.violation),
            self.penalty * slope if value > 0.0 else 0.0,
            self.penalty * (seen - self.violation),
        )

    def reduced(self, weights: Array, room: int) -> SoftConstraint:
        """Return the constraint with at most ``room`` planes, see `Bundle.reduced`."""
        total = float(weights.sum())
        shares = np.asarray(weights / (total if total > 0.0 else 1.0), dtype=np.float64)
        return replace(self, bundle=self.bundle.reduced(shares, room))

    def refined(self, plane: Plane) -> SoftConstraint:
        """Return the constraint after its centre was re-evaluated."""
        return replace(self, bundle=self.bundle.refined(plane, plane.value - self.value), value=plane.value)

    def moved(self, plane: Plane, move: Array, locality: float) -> SoftConstraint:
        """Return the constraint seen from a new centre, whose plane is the last one."""
        bundle = self.bundle.moved(move, plane.value - self.value, locality * plane.length)
        return replace(self, bundle=bundle, value=plane.value)

    def without_doubtful_planes(self) -> SoftConstraint:
        """Return the constraint without doubtful planes."""
        return replace(self, bundle=self.bundle.chosen(np.flatnonzero(~self.bundle.doubtful)))
