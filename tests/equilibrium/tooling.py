"""Blocks under rigid tools that forces, springs and motions move."""

from __future__ import annotations

from fenics_contact import (
    Body,
    ContactPair,
    Coulomb,
    RigidPlane,
    RigidSphere,
    RigidTool,
    Scene,
    Support,
    Surface,
    ToolMotion,
)
from fenics_contact.gallery import block
from fenics_contact.materials import IsotropicElasticity

SOFT = IsotropicElasticity(1000.0, 0.3)
BASE = Support("block", "z0")
TOLERANCE = 1e-10
LEFT, RIGHT = (
    RigidTool(name, RigidSphere((x, 0.0, 2.0), 2.0), at=(x, 0.0, 2.0))
    for name, x in (("left", -0.5), ("right", 0.5))
)
PLATE = RigidTool("plate", RigidPlane((0, 0, 0), (0, 0, -1)), at=(0.2, 0.1, 0.0))
DOWN = (0.0, 0.0, None)
STRAIGHT = (0.0, 0.0, 0.0)


def pressed(
    *supports: Support | ToolMotion, tools: tuple[RigidTool, ...] = (LEFT,), friction: float = 0.2
) -> Scene:
    """A block under tools."""
    pairs = [ContactPair(Surface("block", "z1"), tool, Coulomb(friction)) for tool in tools]
    return Scene(
        {"block": Body(block((-1, -1, -1), (1, 1, 0), (8, 8, 4)), SOFT)}, [BASE, *supports], contacts=pairs
    )


def sprung(friction: float = 0.2) -> Scene:
    """Two tools: one free to move and turn in a plane, one on a spring."""
    motions = (
        ToolMotion("left", (None, 0, None), (0, None, 0), (0.1, 0, -3.0), (0, 0.05, 0)),
        ToolMotion("right", DOWN, STRAIGHT, (0, 0, -2.0), stiffness=(0, 0, 30.0)),
    )
    return pressed(*motions, tools=(LEFT, RIGHT), friction=friction)
