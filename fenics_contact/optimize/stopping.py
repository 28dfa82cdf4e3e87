"""When to stop: the predicted decrease, the certificate, and the limits."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np

from fenics_contact.optimize.result import Reason
from fenics_contact.optimize.subproblem import Step

_CERTIFICATE = 10.0  # slack of the certificate beside the predicted decrease


@dataclass(frozen=True)
class StoppingTest:
    r"""Test on the predicted decrease w and on the certificate σ + r‖z‖.

    For a convex J no feasible point within the distance r is lower than the centre by more than
    σ + r‖z‖: this certificate holds for any t. The predicted decrease w = σ + t‖z‖² could be small only
    because t is, so it is also tested with the first t.

    Attributes:
        limit: Decrease of J that is not worth a step, ε (s + \|J\|).
        rounding: Decrease of J below floating-point resolution.
        reach: Least r, in scaled variables; a longer step extends it to its own length.
        first_t: Initial proximal parameter.
    """

    limit: float
    rounding: float
    reach: float
    first_t: float

    def reason(self, step: Step, solve: Callable[[float], Step]) -> Reason | None:
        """Return CONVERGED or STATIONARY where the centre is a solution within the tolerance, else None."""
        certificate = step.aggregate_error + max(self.reach, step.length) * step.aggregate_norm
        if certificate <= self.limit:
            return Reason.STATIONARY
        promising = step.decrease > max(self.limit, self.rounding)
        if promising or (certificate > _CERTIFICATE * self.limit and step.decrease > self.rounding):
            return None
        longer = step if step.t >= self.first_t else solve(self.first_t)
        return Reason.CONVERGED if longer.decrease <= self.limit else None


def stopping_test(
    value: float, *, tolerance: float, value_scale: float, reach: float, first_t: float
) -> StoppingTest:
    """Return the test for a centre with this value of J."""
    rounding = 4.0 * float(np.finfo(float).eps) * abs(value)
    return StoppingTest(tolerance * (value_scale + abs(value)), rounding, reach, first_t)
