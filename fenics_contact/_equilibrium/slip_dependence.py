"""Friction coefficients that depend on the slip: solved again until coefficients and slips agree."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, replace

import numpy as np

from fenics_contact._base.display import counted
from fenics_contact._equilibrium.passes import OuterLoop, Passes, Relaxation
from fenics_contact.errors import ConvergenceError, InvalidInputError
from fenics_contact.feti.torn import TornSystem
from fenics_contact.results.linear_state import LinearState
from fenics_contact.results.state import State


def coefficients(torn: TornSystem, slip: np.ndarray) -> np.ndarray:
    """Return μ of the frictional points at slips of all points, shape (n, dim − 1); others keep theirs."""
    result, way = torn.groups.slips.coefficient.copy(), np.linalg.norm(slip, axis=1)[torn.frictional]
    pairs = torn.points.pair[torn.frictional]
    for number, pair in enumerate(torn.scene.contacts):
        if pair.slip_table is not None:
            result[pairs == number] = pair.slip_table.at(way[pairs == number])
    return result


def with_coefficients(torn: TornSystem, coefficient: np.ndarray) -> TornSystem:
    """Return a system with other friction coefficients of its frictional points."""
    groups = torn.groups
    return replace(torn, groups=replace(groups, slips=groups.slips.with_coefficient(coefficient)))


@dataclass(frozen=True)
class FrictionBySlip(OuterLoop):
    """Friction coefficients of pairs with a `SlipTable`: passes until they are those of the slips."""

    name = "friction that depends on slip"
    max_passes: int = 100

    def require_derivatives(self, torn: TornSystem, before: State | None) -> None:
        """Reject later load steps, whose slip begins at a state that depends on the shape, too."""
        if before is not None:
            raise InvalidInputError(
                "derivatives with friction by slip need one load step: give a number or a FrictionTable"
            )

    def solve(self, passes: Passes, torn: TornSystem, before: State | None, tolerance: float) -> LinearState:
        """Return the state whose friction coefficients are those of its slips. Collective.

        Every pass is one solution at given coefficients, of whose change the next takes over a part,
        see `Relaxation`: less than all where changes alternate, as friction that rises steeply makes them,
        and more where they only get smaller. Where friction falls faster with the slip than bodies are
        stiff, changes grow in one direction: θ = 1 follows them to where it falls no more. There may be
        several states, or none.

        The tolerance is the largest change of a slip bound relative to the largest. That of passes is
        smaller: their errors must not pass for changes of friction.
        """
        slip = np.zeros((torn.points.count, torn.components - 1))
        latest = passes.latest
        if latest is not None and latest.contact.total_slip.shape == slip.shape:
            slip = latest.contact.total_slip
        mu, relaxation = coefficients(torn, slip), Relaxation()
        while passes.count < self.max_passes:
            state = passes.run(with_coefficients(torn, mu), min(tolerance, max(0.1 * tolerance, 1e-10)))
            contact = state.contact
            target = coefficients(torn, contact.total_slip)
            pressed = contact.normal_force[torn.frictional]
            size = float((np.maximum(mu, target) * pressed).max(initial=0.0))
            missing = (target - mu) * pressed
            change = float(np.abs(missing).max(initial=0.0)) / (size or 1.0)
            passes.remark(f"slip pass {passes.count}: slip bounds changed by {change:.1e}")
            if change <= tolerance:
                return passes.answer(state)
            mu = np.maximum(mu + relaxation.of(missing) * (target - mu), 0.0)
        after = counted(passes.count, "pass", "passes")
        raise ConvergenceError(
            f"friction coefficients must agree with the slips, after {after} slip bounds still change by "
            f"{change:.1e}, as in stick-slip; take smaller load steps, or drive the bodies",
            passes.history,
        )

    def stored(self, torn: TornSystem) -> dict[str, np.ndarray]:
        """Return the coefficients."""
        return {"coefficient": torn.groups.slips.coefficient}

    def restored(self, torn: TornSystem, stored: Mapping[str, np.ndarray]) -> TornSystem:
        """Return the system with the coefficients as they were."""
        return with_coefficients(torn, stored["coefficient"])
