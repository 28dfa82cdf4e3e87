"""Wear in adjoints: depths follow pressures, slips, areas and places, and are part of all later gaps."""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import cast

import numpy as np

from fenics_contact.design.adjoint import Adjoint, Coupling, on_owned, with_slips
from fenics_contact.design.objective import Partials
from fenics_contact.errors import together
from fenics_contact.feti.point_wear import PointWear
from fenics_contact.results.contact import Status
from fenics_contact.results.linear_state import LinearState


@dataclass(frozen=True, eq=False)
class WearBySlip(Coupling):
    """Distances D(s) that agree with the slips s of a state, over which contact takes the depth D r(λ / A).

    A depth opens its contact, whose adjoint multiplier is ζ, and is part of the depth w on which objectives
    and later steps depend: ∂J/∂(D r) = ζ + ∂J/∂w. By D = D(s) the objective depends on slips in turn, by
    y = (ζ + ∂J/∂w) r D'(s), along the slip. At held D, the law knows what of it follows forces and areas.

    `rate`: r; `slope`: r D'(s); `direction`: of the slips, of all points.
    """

    state: LinearState
    wear: PointWear
    rate: np.ndarray
    slope: np.ndarray
    direction: np.ndarray

    @classmethod
    def of(cls, state: LinearState) -> WearBySlip:
        """Return that of a state."""
        wear, contact = cast(PointWear, state.torn.wear), state.contact
        way, rate = np.linalg.norm(contact.slip, axis=1), wear.of_curves("rate", contact.pressure)
        # What sticks has slipped by errors of the solver alone.
        slope = np.where((contact.status == Status.STICK) | (way == 0.0), 0.0, rate * wear.by_way(way))
        return cls(state, wear, rate, slope, contact.slip / np.where(way > 0.0, way, 1.0)[:, None])

    def begun(self, partials: Partials) -> Partials:
        """Return the derivatives with those of the depth by forces and areas, at held distances."""
        torn, contact = self.state.torn, self.state.contact
        growth = self.wear.of_curves("growth", contact.pressure) / contact.area
        by_force = partials.by_worn * self.wear.distance(contact.slip) * growth
        return replace(
            partials,
            by_multiplier=partials.by_multiplier + on_owned(torn, torn.normal_rows, by_force),
            by_area=partials.by_area - by_force * contact.pressure,
        )

    def read(self, partials: Partials, adjoint: Adjoint) -> np.ndarray:
        """Return y where distances grow with the slip. Collective."""
        return np.asarray((self.slope * self._by_depth(partials, adjoint))[self.slope != 0.0])

    def following(self, partials: Partials, y: np.ndarray) -> Partials:
        """Return the derivatives with those by the slips. Collective."""
        by_slip = np.zeros(self.direction.shape)
        by_slip[self.slope != 0.0] = y[:, None] * self.direction[self.slope != 0.0]
        return with_slips(self.state, partials, by_slip)

    def ended(self, partials: Partials, adjoint: Adjoint) -> Partials:
        """Return the derivatives with those by places, where the law has functions of them. Collective."""
        torn, by_depth = self.state.torn, self._by_depth(partials, adjoint)
        with together(torn.decomposition.comm):
            by_place = self.wear.by_place(np.linalg.norm(self.state.contact.slip, axis=1))
        by_shape = partials.by_shape.copy()
        if torn.decomposition.comm.rank == 0:
            np.add.at(by_shape, torn.points.slave, (self.rate * by_depth)[:, None] * by_place)
        return replace(partials, by_shape=by_shape)

    def _by_depth(self, partials: Partials, adjoint: Adjoint) -> np.ndarray:
        torn = self.state.torn
        return np.asarray(torn.gathered(adjoint.multiplier, torn.groups.normal) + partials.by_worn)
