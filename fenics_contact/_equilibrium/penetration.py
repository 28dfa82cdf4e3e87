"""How far fluid enters a contact: solved again until its front stays where it is."""

from __future__ import annotations

import logging
from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np

from fenics_contact._base.display import counted
from fenics_contact._equilibrium.passes import OuterLoop, Passes
from fenics_contact._large_deformations.fluid import EnteredFluid
from fenics_contact._large_deformations.load_steps import AutomaticSteps
from fenics_contact._large_deformations.moving_contact import Contact
from fenics_contact._scene.fluids_of_pairs import pressures_of
from fenics_contact._scene.scene import Scene
from fenics_contact.errors import InvalidInputError
from fenics_contact.errors.kinds import safe_log
from fenics_contact.feti.fluid_front import Front, returning
from fenics_contact.feti.torn import TornSystem
from fenics_contact.results.linear_state import LinearState
from fenics_contact.results.state import State

_LOG = logging.getLogger(__name__)


def wetted(torn: TornSystem, front: Front, wet: np.ndarray) -> TornSystem:
    """Return a system with fluid at wet nodes of a front, shape (n,). Collective."""
    points, pressure = torn.points, front.pressures(pressures_of(torn.scene.contacts))
    at_points = front.at_points(np.where(wet, pressure, 0.0), points)
    return torn.with_fluid(at_points, front.at_points(wet, points) > 0.0, at_points * points.area)


def front_of(torn: TornSystem) -> Front:
    """Return the front among the contact points of a system. Collective."""
    points, scene = torn.points, torn.scene
    nodes = [points.slave[points.pair == number] for number in range(len(scene.contacts))]
    return Front.of(scene, torn.decomposition.tearing, torn.decomposition.comm, nodes)


@dataclass(frozen=True)
class FluidFront(OuterLoop):
    """The front of fluids that enter contacts: passes until it stays where it is."""

    scene: Scene

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
        front, points, latest = front_of(torn), torn.points, passes.latest
        wet, by_name = np.zeros(len(front.inlet), dtype=bool), pressures_of(torn.scene.contacts)
        if latest is not None and latest.contact.wet is not None:
            wet = front.at_nodes(latest.contact.wet, latest.contact.points) > 0.0
        earlier: list[bytes] = []
        while wet.tobytes() not in earlier:
            earlier.append(wet.tobytes())
            state = passes.run(wetted(torn, front, wet), tolerance)
            words = f"fluid pass {passes.count}: {counted(int(wet.sum()), 'point')} wet"
            safe_log(_LOG.info, "%s", words)
            passes.remark(words)
            following = front.reached(points, state.contact.pressure, by_name)
            if np.array_equal(following, wet):
                return passes.answer(state)
            wet = following
        raise returning(counted(passes.count, "pass", "passes"), int(wet.sum()), passes.history)

    def feedback(self, contact: Contact, before: State | None, steps: AutomaticSteps) -> tuple[EnteredFluid]:
        """Return fluid in contacts of bodies that deform much, where a state has left it. Collective.

        Raises:
            InvalidInputError: If bodies may snap: fluid enters between equilibria.
        """
        if steps.snaps:
            raise InvalidInputError(
                "fluid enters from equilibrium to equilibrium, got AutomaticSteps with snaps: leave it out"
            )
        marks = np.zeros(0, dtype=bool) if before is None else before.torn.fluid.marks
        return (EnteredFluid.of(self.scene, contact, marks),)

    def stored(self, torn: TornSystem) -> dict[str, np.ndarray]:
        """Return where fluid is."""
        return {} if torn.fluid.wet is None else {"wet": torn.fluid.wet, "wet_nodes": torn.fluid.marks}

    def restored(self, torn: TornSystem, stored: Mapping[str, np.ndarray]) -> TornSystem:
        """Return the system with fluid where it was. Collective."""
        if "wet" not in stored:
            return torn
        front = front_of(torn)
        return wetted(torn, front, front.at_nodes(stored["wet"], torn.points) > 0.0)

    def stored_feedback(self, contact: Contact, stored: Mapping[str, np.ndarray]) -> tuple[EnteredFluid]:
        """Return fluid in contacts of bodies that deform much where a stored state had it. Collective."""
        return (EnteredFluid.of(self.scene, contact, stored["wet_nodes"]),)
