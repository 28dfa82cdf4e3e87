"""Small parts that the hard scenes are made of."""

from __future__ import annotations

from dataclasses import replace
from itertools import pairwise

import numpy as np

from fenics_contact import (
    Body,
    BodyMesh,
    ContactPair,
    Coulomb,
    RigidPlane,
    Scene,
    Support,
    Surface,
    TotalForce,
)
from fenics_contact.gallery import block
from fenics_contact.materials import IsotropicElasticity
from tests.scenes import Friction, Load, RigidObstacle

SOFT, STIFF = IsotropicElasticity(100.0, 0.3), IsotropicElasticity(300.0, 0.2)
UP = (0.0, 0.0, 1.0)
FLOOR = RigidPlane((0.0, 0.0, 0.0), UP)


def plane(height: float, up: bool = True) -> RigidPlane:
    """Return a level rigid plane."""
    return RigidPlane((0.0, 0.0, height), (0.0, 0.0, 1.0 if up else -1.0))


def on_floor(
    mesh: BodyMesh, load: Load, friction: Friction, floor: RigidObstacle = FLOOR, **parts: object
) -> Scene:
    """Return a block that stands on an obstacle under a load."""
    pair = ContactPair(Surface("block", "z0"), floor, friction)
    return Scene({"block": Body(mesh, SOFT)}, loads=[load], contacts=[pair], **parts)  # type: ignore[arg-type]


def force(x: float, y: float, z: float, body: str = "block", surface: str = "z1") -> TotalForce:
    """Return a total force on top of a body."""
    return TotalForce(body, surface, (x, y, z))


def cubes(count: int, cells: int = 2, friction: Friction = None) -> Scene:
    """Return cubes on top of each other on a floor, every other one narrower and of a finer mesh."""
    bodies = {}
    for level in range(count):
        inset, n = 0.02 * (level % 2), cells + level % 2
        low, high = np.array([inset, inset, level]), np.array([1.0 - inset, 1.0 - inset, level + 1.0])
        bodies[f"cube {level}"] = Body(block(low, high, (n, n, n)), SOFT)
    return Scene(bodies, contacts=tower_pairs(bodies, friction))


def tower_pairs(bodies: dict[str, Body], friction: Friction) -> list[ContactPair]:
    """Let every body stand on the one before it, and the first one on a floor."""
    names = list(bodies)
    pairs = [ContactPair(Surface(names[0], "z0"), FLOOR, friction)]
    for below, above in pairwise(names):
        low, high = bodies[below].mesh.surfaces["z1"], bodies[above].mesh.surfaces["z0"]
        slave = Surface(above, "z0"), Surface(below, "z1")
        # The surface inside the other one is the slave.
        smaller = np.ptp(bodies[above].mesh.points[high], axis=(0, 1)).sum()
        larger = np.ptp(bodies[below].mesh.points[low], axis=(0, 1)).sum()
        pairs.append(ContactPair(*(slave if smaller <= larger else slave[::-1]), friction, "node"))
    return pairs


def clamped(scene: Scene, body: str, surface: str = "z0") -> Scene:
    """Clamp a surface of a body."""
    return replace(scene, supports=[*scene.supports, Support(body, surface)])


def coulomb(value: float) -> Coulomb:
    return Coulomb(value)
