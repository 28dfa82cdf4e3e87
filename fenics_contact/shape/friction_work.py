"""The work of friction as an objective."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from fenics_contact.checks import checked
from fenics_contact.contact import State
from fenics_contact.errors import InvalidInputError
from fenics_contact.shape.contact_forces import on_rows
from fenics_contact.shape.forms import ShapeForms
from fenics_contact.shape.objective import Partials, require_linear
from fenics_contact.shape.pressures import points_of
from fenics_contact.shape.sums import Weighable


@dataclass(frozen=True)
@checked()
class FrictionWork(Weighable):
    """J = Σ τ_i · s_i, the work dissipated by friction in one load step, [force · length].

    Friction acts along the slip since the step before, so that each point's work is the product of its force
    and the length of its slip, and zero where it sticks. By Archard's law the volume worn off is proportional
    to it. The force is that at the end of the step. `ShapeProblem` applies the whole load in one step from
    rest; `LoadPath` adds up the work of several steps.

    Attributes:
        pair: Number of the contact pair in the scene; None for all.
    """

    pair: int | None = None

    def value(self, state: State, forms: ShapeForms) -> float:
        """Return the work.

        Raises:
            InvalidInputError: If there is no such pair or it has no friction.
        """
        force, slip = self._vectors(state)
        return float((force * slip).sum())

    def partials(self, state: State, forms: ShapeForms) -> Partials:
        """∂J/∂τ = s, ∂J/∂s = τ with the slips s = B_T u − Q_T q − c_T. Collective; raises as `value` does."""
        force, slip = self._vectors(state)
        by_slip, free = on_rows(state, None, force), state.torn.free
        by_motion = -np.asarray(state.torn.decomposition.comm.allreduce(free.columns.T @ by_slip))
        return Partials.of(
            state,
            float((force * slip).sum()),
            by_displacement=state.torn.force(by_slip),
            by_multiplier=on_rows(state, None, slip),
            by_motion=by_motion,
            by_jump=by_slip,
        )

    def _vectors(self, state: State) -> tuple[np.ndarray, np.ndarray]:
        """Return friction forces and slips of the points with friction, zero elsewhere."""
        require_linear(state, self)
        contact = state.contact
        mine = np.intersect1d(points_of(state, "FrictionWork", self.pair), state.torn.frictional)
        if len(mine) == 0:
            where = "contact pairs have" if self.pair is None else f"contact pair {self.pair} has"
            raise InvalidInputError(
                f"FrictionWork needs friction, but the scene's {where} none: give a ContactPair Coulomb or "
                "Tresca friction"
            )
        chosen = np.zeros((contact.points.count, 1))
        chosen[mine] = 1.0
        return chosen * contact.friction_force, chosen * contact.slip
