"""A die pressed into rubber and drawn along it."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from fenics_contact import Body, BodyMesh, ContactPair, Coulomb, Scene, Support, Surface
from fenics_contact.gallery import rectangle
from fenics_contact.materials import NeoHooke

#: Depths and ways of a die that is pressed into a block and drawn along it.
WAY = [(0.0, -0.4), (0.0, -0.8), (0.25, -0.8), (0.5, -0.8)]


def die(cells: int) -> BodyMesh:
    """A square whose lower side is an arc."""
    mesh = rectangle((0.2, 4.2), (1.4, 5.4), (cells, cells))
    x, y = mesh.points.T
    radius = (0.6**2 + 0.3**2) / 0.6
    low = 4.2 + radius - np.sqrt(radius**2 - (x - 0.8) ** 2)
    return replace(mesh, points=np.column_stack([x, low + (5.4 - low) * (y - 4.2) / 1.2]))


def turned(mesh: BodyMesh, quarter: bool) -> BodyMesh:
    return replace(mesh, points=mesh.points @ [[0.0, 1.0], [-1.0, 0.0]]) if quarter else mesh


def ironing(friction: float, way: tuple[float, float], quarter: bool = False) -> Scene:
    x, y = way
    move = (-y, x) if quarter else (x, y)
    block = turned(rectangle((0.0, 0.0), (6.0, 4.0), (24, 12)), quarter)
    law = Coulomb(friction) if friction else None
    pair = ContactPair(Surface("die", "y0"), Surface("block", "y1"), law, discretisation="node")
    return Scene(
        {
            "block": Body(block, NeoHooke(1.0, 0.32)),
            "die": Body(turned(die(10), quarter), NeoHooke(10.0, 0.32)),
        },
        [Support("block", "y0"), Support("die", "y1", move)],
        contacts=[pair],
    )
