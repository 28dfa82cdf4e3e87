"""Bodies with both heat and mechanics."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace

import numpy as np

from fenics_contact import Body, ContactPair, Coulomb, Scene, Support, Surface
from fenics_contact.gallery import rectangle
from fenics_contact.heat import (
    Conductor,
    FrictionHeat,
    HeatScene,
    HeldTemperature,
    ThermalContact,
)
from fenics_contact.materials import PlaneStrain
from tests.heat.heated_bodies import YOUNG, film, rod

#: Of the rod that closes its gap in time, and the time at which it is looked at.
CAPACITY, CLEARANCE, END = 4.0, 0.02, 1.0


def sliding(friction: FrictionHeat, law: Coulomb, *, other_way: bool = False) -> tuple[Scene, HeatScene]:
    """Return a block that is pressed onto another one and pushed along it by 0.3."""
    material = PlaneStrain(YOUNG, 0.3, thermal_expansion=1e-5)
    bodies = {
        "lower": Body(rectangle((0.0, 0.0), (3.0, 1.0), (9, 2)), material),
        "upper": Body(rectangle((0.5, 1.0), (1.5, 2.0), (4, 3)), material),
    }
    sides = Surface("upper", "y0"), Surface("lower", "y1")
    held = [Support("lower", "y0"), Support("upper", "y1", (0.3, -0.01))]
    scene = Scene(bodies, held, contacts=[ContactPair(*sides, law, discretisation="node")])
    cooled = [HeldTemperature("lower", "y0", 0.0), HeldTemperature("upper", "y1", 0.0)]
    sides = sides[::-1] if other_way else sides
    joint = ThermalContact(*sides, 50.0, friction=friction, discretisation="node")
    steel = {name: Conductor(2.0, 1.0) for name in bodies}
    return scene, HeatScene.on(scene, steel, held=cooled, contacts=[joint])


def ramp(time: float) -> float:
    """Return the temperature of the clamp."""
    return 100.0 * (1.0 - np.exp(-3.0 * time))


def closing() -> tuple[Scene, Callable[[float], HeatScene]]:
    """Return a rod whose clamp warms until the rod touches a wall, which cools it."""
    scene, heat = rod(film(0.1, 0.01), 0.0, 0.0, CLEARANCE)
    (body,), (joint,) = heat.bodies.values(), heat.contacts
    bodies = {"rod": replace(body, material=Conductor(1.0, CAPACITY))}

    def at(time: float) -> HeatScene:
        return replace(heat, bodies=bodies, held=[HeldTemperature("rod", "x0", ramp(time))])

    assert joint.law.by_contact
    return scene, at
