"""How far fluid enters a contact: solved again until its front stays where it is."""

from __future__ import annotations

import logging
from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np
import scipy.sparse as sp
from scipy.sparse.csgraph import connected_components

from fenics_contact._base.display import counted
from fenics_contact._equilibrium.passes import OuterLoop, Passes
from fenics_contact.errors import ConvergenceError, InvalidInputError, together
from fenics_contact.errors.kinds import safe_log
from fenics_contact.feti.torn import TornSystem
from fenics_contact.results.contact import ContactResult
from fenics_contact.results.linear_state import LinearState
from fenics_contact.results.state import State

_LOG = logging.getLogger(__name__)


@dataclass(frozen=True, eq=False)
class Front:
    """The contact points that fluid may reach, and from where; replicated.

    `neighbours`: points that share a facet of the slave; `inlet`: points where fluid enters; `critical`:
    contact pressures up to which points count as open.
    """

    neighbours: sp.csr_matrix
    inlet: np.ndarray
    pressure: np.ndarray
    critical: np.ndarray

    def at(self, torn: TornSystem, wet: np.ndarray) -> TornSystem:
        """Return a system with fluid at wet points, shape (n,). Collective."""
        return torn.with_fluid(np.where(wet, self.pressure, 0.0), wet)

    @classmethod
    def of(cls, torn: TornSystem) -> Front:
        """Prepare the graph of points of pairs with a fluid. Collective."""
        scene, points, count = torn.scene, torn.points, torn.points.count
        inlet, (pressure, critical) = np.zeros(count, dtype=bool), np.zeros((2, count))
        rows: list[np.ndarray] = []
        columns: list[np.ndarray] = []
        with together(torn.decomposition.comm):
            for number, pair in enumerate(scene.contacts):
                if pair.fluid is None:
                    continue
                body = scene.bodies[pair.slave.body].mesh
                first = torn.decomposition.tearing.first_of(pair.slave.body)
                mine = np.flatnonzero(points.pair == number)
                nodes = points.slave[mine] - first
                named = pair.fluid.enters if isinstance(pair.fluid.enters, str) else pair.slave.name
                shared = np.isin(nodes, body.surfaces[named])
                inlet[mine] = pair.fluid.inlet(body.points[nodes], shared)
                pressure[mine], critical[mine] = pair.fluid.pressure, pair.fluid.opens_at
                number_of = np.full(body.n_nodes, -1)
                number_of[nodes] = mine
                facets = number_of[body.surfaces[pair.slave.name]]
                one, other = (
                    np.broadcast_arrays(facets[:, :, None], facets[:, None, :])[k].ravel() for k in (0, 1)
                )
                both = (one >= 0) & (other >= 0)
                rows.append(one[both])
                columns.append(other[both])
        row, column = np.concatenate(rows), np.concatenate(columns)
        neighbours = sp.csr_matrix((np.ones(len(row)), (row, column)), shape=(count, count))
        return cls(neighbours, inlet, pressure, critical)

    def reached(self, contact: ContactResult) -> np.ndarray:
        """Return the open points that are connected with the inlet, shape (n,)."""
        open_ = contact.pressure <= self.critical
        kept = sp.diags(open_.astype(float))
        _, part = connected_components(kept @ self.neighbours @ kept, directed=False)
        return open_ & np.isin(part, part[open_ & self.inlet])


class FluidFront(OuterLoop):
    """The front of fluids that enter contacts: passes until it stays where it is."""

    name = "fluid that enters contacts"

    def require_derivatives(self, torn: TornSystem, before: State | None) -> None:
        """Reject motions that are found: they move with the front."""
        if torn.free.count:
            raise InvalidInputError(
                "derivatives by the shape need known motions where fluid enters a contact: prescribe them"
            )

    def solve(self, passes: Passes, torn: TornSystem, before: State | None, tolerance: float) -> LinearState:
        """Return the state in which fluid is just where contact is open to it. Collective.

        Every pass is one solution; fluid that opens the next points moves on. Where the front comes back to
        an earlier place, pressures and friction let it move forth and back, and there is no such state.
        """
        front = Front.of(torn)
        wet = np.zeros(torn.points.count, dtype=bool)
        latest = passes.latest
        if latest is not None and latest.contact.wet is not None and len(latest.contact.wet) == len(wet):
            wet = latest.contact.wet
        earlier: list[bytes] = []
        while wet.tobytes() not in earlier:
            earlier.append(wet.tobytes())
            state = passes.run(front.at(torn, wet), tolerance)
            words = f"fluid pass {passes.count}: {counted(int(wet.sum()), 'point')} wet"
            safe_log(_LOG.info, "%s", words)
            passes.remark(words)
            following = front.reached(state.contact)
            if np.array_equal(following, wet):
                return passes.answer(state)
            wet = following
        after, there = counted(passes.count, "pass", "passes"), counted(int(wet.sum()), "wet point")
        raise ConvergenceError(
            f"the front of a fluid must come to rest, but after {after} it returns to {there} where it was "
            "before: take smaller load steps, refine the contact, or give the fluid a critical pressure",
            passes.history,
        )

    def stored(self, torn: TornSystem) -> dict[str, np.ndarray]:
        """Return where fluid is."""
        return {} if torn.fluid.wet is None else {"wet": torn.fluid.wet}

    def restored(self, torn: TornSystem, stored: Mapping[str, np.ndarray]) -> TornSystem:
        """Return the system with fluid where it was. Collective."""
        return Front.of(torn).at(torn, stored["wet"]) if "wet" in stored else torn
