"""Friction coefficients that are those of slips, as the adjoint knows them."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from fenics_contact.design.adjoint import Adjoint, Coupling, LinearisedFace, with_slips
from fenics_contact.design.contact_derivatives import bound_sensitivity
from fenics_contact.design.objective import Partials
from fenics_contact.results.linear_state import LinearState


@dataclass(frozen=True, eq=False)
class SlipFriction(Coupling):
    """Coefficients μ(s) that agree with the slips s of a state.

    With coefficients held, the adjoint gives ∂J/∂Ψ of slip bounds. By Ψ = μ(s) λ_N these depend on slips,
    which the objective depends on in turn by y = ∂J/∂Ψ λ_N μ'(s), along the slip.

    `slope`: ∂Ψ/∂s of frictional points, (n_friction,), [force / length]; `direction`: of their slips.
    """

    state: LinearState
    linearised: LinearisedFace
    slope: np.ndarray
    direction: np.ndarray

    @classmethod
    def of(cls, state: LinearState, linearised: LinearisedFace) -> SlipFriction:
        """Return that of a state. Collective."""
        torn, contact = state.torn, state.contact
        slip, pressed = contact.total_slip[torn.frictional], contact.normal_force[torn.frictional]
        way, slope = np.linalg.norm(slip, axis=1), np.zeros(len(slip))
        pairs = torn.points.pair[torn.frictional]
        for number, pair in enumerate(torn.scene.contacts):
            if pair.slip_table is not None:
                slope[pairs == number] = pair.slip_table.growth(way[pairs == number])
        slope[torn.groups.slips.strength.limited(pressed)] = 0.0
        slope[way == 0.0] = 0.0
        return cls(state, linearised, slope * pressed, slip / np.where(way > 0.0, way, 1.0)[:, None])

    def read(self, partials: Partials, adjoint: Adjoint) -> np.ndarray:
        """Return y where coefficients change with the slip. Collective."""
        w = adjoint.displacement
        by_bound = bound_sensitivity(self.state.torn, partials.by_multiplier, w, self.linearised)
        return np.asarray((self.slope * by_bound)[self.slope != 0.0])

    def following(self, partials: Partials, y: np.ndarray) -> Partials:
        """Return the derivatives with those by the slips. Collective."""
        by_slip = np.zeros((self.state.torn.points.count, self.direction.shape[1]))
        chosen = np.flatnonzero(self.slope)
        by_slip[self.state.torn.frictional[chosen]] = y[:, None] * self.direction[chosen]
        return with_slips(self.state, partials, by_slip)
