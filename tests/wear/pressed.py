"""A block that is pressed on a cylinder and moved to and fro."""

from __future__ import annotations

from typing import Any

from fenics_contact import (
    Body,
    ContactPair,
    Coulomb,
    LoadStep,
    RigidSphere,
    Scene,
    Support,
    Surface,
    Wear,
)
from fenics_contact.gallery import rectangle


def pressed(material: Any, wear: Wear, friction: float | None, deep: float, way: float) -> Any:
    """Return a block that is pressed on a cylinder and moved to and fro, and its load steps."""
    body = Body(rectangle((-4.0, 0.0), (4.0, 4.0), (16, 8)), material)
    law = None if friction is None else Coulomb(friction)
    pair = ContactPair(Surface("punch", "y0"), RigidSphere((0.0, -50.0), 50.0), law, wear=wear)
    scene = Scene({"punch": body}, [Support("punch", "y1", (0.0, -deep))], contacts=[pair])
    moves = [
        LoadStep(f"{cycles} to {x}", supports=[Support("punch", "y1", (x, -deep))], cycles=cycles)
        for x, cycles in ((way, 1.0), (-way, 1.0), (way, 20.0))
    ]
    return scene, [LoadStep("press"), *moves]
