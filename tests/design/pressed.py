"""A crowned block pressed on a floor so that one point lies on a switch of the contact law, to rounding."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from functools import cache

import numpy as np

from fenics_contact import Body, ContactPair, Coulomb, Scene, Status, Support, Surface
from fenics_contact.design import WeakChoice
from fenics_contact.gallery import block
from fenics_contact.results import ContactResult
from tests.design.blocks import RUBBER, problem
from tests.design.quotients import Line, Remembering
from tests.scenes import FLOOR, Friction, crowned


@dataclass(frozen=True)
class Pressed:
    """How the top of the block is moved, and what happens below.

    Attributes:
        friction: Law on the floor.
        depth: Way down.
        drag: Way along x.
    """

    friction: Friction
    depth: float
    drag: float

    def problem(self, choice: WeakChoice = WeakChoice.RELEASED) -> Remembering:
        mesh = crowned(block((0.0, 0.0, 0.0), (2.0, 1.0, 1.0), (6, 3, 3)), 0.03)
        support = Support("block", "z1", (self.drag, 0.0, -self.depth))
        pair = ContactPair(Surface("block", "z0"), FLOOR, self.friction)
        return problem(Scene({"block": Body(mesh, RUBBER)}, [support], contacts=[pair]), choice=choice)

    def contact(self) -> ContactResult:
        return self.problem().state_of(DESIGN).contact


#: A design without symmetry: points reach the switch one by one.
DESIGN = 0.003 * np.random.default_rng(1).standard_normal(6)
DIRECTION = np.random.default_rng(4).standard_normal(6)


@cache
def about_to_close(friction: Friction) -> Pressed:
    """Press until the next open point touches without force: the secant method on its gap."""
    start = Pressed(friction, 0.025, 0.004)
    contact = start.contact()
    point = int(np.argmin(np.where(contact.status == Status.OPEN, contact.gap, np.inf)))
    depth, gap = start.depth, float(contact.gap[point])
    earlier, earlier_gap = depth, gap
    depth = depth + 0.3 * gap
    for _ in range(10):
        gap = float(Pressed(friction, depth, start.drag).contact().gap[point])
        if abs(gap) < 1e-12:
            return Pressed(friction, depth, start.drag)
        earlier, earlier_gap, depth = depth, gap, depth - gap * (depth - earlier) / (gap - earlier_gap)
    raise AssertionError(f"the gap of point {point} must vanish, got {gap}")


@cache
def about_to_slip() -> Pressed:
    """Let everything stick, then lower the friction coefficient to the largest ratio of the forces."""
    contact = Pressed(Coulomb(5.0), 0.03, 0.002).contact()
    assert contact.count(Status.SLIP) == 0
    closed = contact.status == Status.STICK
    ratio = np.linalg.norm(contact.friction_force[closed], axis=1) / contact.normal_force[closed]
    return Pressed(Coulomb(float(ratio.max())), 0.03, 0.002)


def line(pressed: Pressed, choice: WeakChoice) -> Line:
    return Line(pressed.problem(choice), DESIGN, DIRECTION, 1e-5)


SWITCHES: dict[str, Callable[[], Pressed]] = {
    "closing, frictionless": lambda: about_to_close(None),
    "closing with friction": lambda: about_to_close(Coulomb(0.3)),
    "slipping": about_to_slip,
}
