"""A rubber lip on a floor, and a ring in a groove, that fluid may enter."""

from __future__ import annotations

from typing import Any

from fenics_contact import (
    Body,
    ContactPair,
    Coulomb,
    FluidPressure,
    MovingObstacle,
    RigidPlane,
    Scene,
    Support,
    Surface,
)
from fenics_contact.gallery import disc, rectangle
from fenics_contact.materials import NeoHooke

RUBBER = NeoHooke(5.0, 0.4)
FLOOR = RigidPlane((0.0, 0.0), (0.0, 1.0))


def lip(x: float = 4.0, top: float = -0.12, fluid: FluidPressure | None = None, **more: Any) -> Scene:
    """A crowned block pressed on a floor; fluid enters from its left."""
    mesh = rectangle((0.0, 0.0), (x, 1.0), (17, 5))
    points = mesh.points.copy()
    points[:, 1] += 0.03 * (points[:, 0] - 1.9) ** 2 * (1.0 - points[:, 1])
    fluid = fluid or FluidPressure(0.0, "x0", critical="pressure")
    pair = ContactPair(Surface("lip", "y0"), FLOOR, fluid=fluid, **more)
    held = [Support("lip", "y1", (0.0, top))]
    return Scene({"lip": Body(mesh.moved(points), RUBBER)}, held, contacts=[pair])


def groove(wall: float) -> Scene:
    """A ring between a floor and a lid that close in the first step; fluid drives it against a wall."""

    def closing(side: float) -> MovingObstacle:
        plane = RigidPlane((0.0, side), (0.0, -side))
        return MovingObstacle(plane, lambda time: (None, (0.0, -0.2 * side * min(time, 1.0))))

    oil = FluidPressure(0.0, lambda x: x[:, 0] < -0.999, critical="pressure")
    outer, rubbing = Surface("ring", "outer"), Coulomb(0.1)
    pairs = [ContactPair(outer, closing(side), rubbing, fluid=oil) for side in (-1.0, 1.0)]
    pairs.append(ContactPair(outer, RigidPlane((wall, 0.0), (-1.0, 0.0)), rubbing))
    return Scene({"ring": Body(disc(1.0, 6), NeoHooke(6.0, 0.45))}, contacts=pairs)
