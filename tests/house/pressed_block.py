"""A block is pressed evenly on a floor without friction; scripts of other tests solve it."""

from __future__ import annotations

from typing import Any

from fenics_contact import Body, ContactPair, RigidPlane, Scene, State, Support, Surface, solve_scene
from fenics_contact.gallery import block
from fenics_contact.materials import IsotropicElasticity

#: ½ E (δ/h)² V.
ENERGY = 0.5 * 100.0 * (0.01 / 0.3) ** 2 * 0.7 * 0.5 * 0.3


def scene() -> Scene:
    """Return the scene, of 7 × 5 × 3 cells."""
    body = Body(block((0, 0, 0), (0.7, 0.5, 0.3), (7, 5, 3)), IsotropicElasticity(100.0, 0.25))
    held = {"x0": (0.0, None, None), "y0": (None, 0.0, None), "z1": (None, None, -0.01)}
    supports = [Support("block", side, value) for side, value in held.items()]
    pair = ContactPair(Surface("block", "z0"), RigidPlane((0, 0, 0), (0, 0, 1)))
    return Scene({"block": body}, supports, (), [pair])


def solve(comm: Any) -> State:
    """Solve the scene. Collective."""
    return solve_scene(scene(), comm)
