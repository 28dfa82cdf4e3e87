"""Blocks of quadratic cells whose contact surfaces are designs, in the plane and in space."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace
from functools import cache

import numpy as np

from fenics_contact import Body, BodyForce, ContactPair, Coulomb, Scene, Support, Surface, Traction, Tresca
from fenics_contact.gallery import block
from fenics_contact.mesh import quadratic
from tests.design.blocks import PLASTIC, RUBBER
from tests.design.objectives import objectives
from tests.design.plane_blocks import line_of, on_block, on_obstacle
from tests.design.quotients import Line
from tests.scenes import FLOOR, Friction, crowned


def on_floor(friction: Friction, cell: str) -> Scene:
    """A crowned block that nothing but a floor holds, pressed and pushed on top."""
    mesh = crowned(quadratic(block((0.0, 0.0, 0.0), (2.0, 1.0, 1.0), (4, 2, 2), cell)), 0.02)
    return Scene(
        {"block": Body(mesh, RUBBER)},
        loads=[Traction("block", "z1", (0.45, 0.1, -2.0))],
        contacts=[ContactPair(Surface("block", "z0"), FLOOR, friction)],
    )


def on_one_another(friction: Friction, cell: str, discretisation: str = "node") -> Scene:
    """A crowned block that only the rounded one under it holds; no node lies over an edge of a facet."""
    lower = quadratic(block((0.0, 0.0, -1.0), (2.0, 1.2, 0.0), (3, 2, 1), cell))
    x, y, z = lower.points.T
    lower = lower.moved(np.column_stack([x, y, z - 0.02 * (x - 1.0) ** 2 * (z + 1.0)]))
    upper = quadratic(block((0.13, 0.07, 0.0), (1.85, 1.09, 0.8), (4, 2, 1), cell))
    return Scene(
        {"lower": Body(lower, PLASTIC), "block": Body(crowned(upper, 0.04), RUBBER)},
        [Support("lower", "z0")],
        [Traction("block", "z1", (0.6, 0.12, -2.0)), BodyForce("block", (0.1, 0.0, -1.0))],
        [ContactPair(Surface("block", "z0"), Surface("lower", "z1"), friction, discretisation)],
    )


def by_mortar(scene: Scene) -> Scene:
    """The scene with means of its gaps."""
    return replace(scene, contacts=[replace(pair, discretisation="mortar") for pair in scene.contacts])


SCENES: dict[str, Callable[[], Scene]] = {
    "plane floor, Tresca": lambda: on_obstacle(Tresca(0.6), "triangle", order=2),
    "plane blocks": lambda: on_block(Coulomb(0.38), "quadrilateral", 2),
    "plane blocks, triangles": lambda: on_block(Coulomb(0.38), "triangle", 2),
    "floor, Tresca, tetrahedra": lambda: on_floor(Tresca(0.6), "tetrahedron"),
    "floor, Tresca": lambda: on_floor(Tresca(0.6), "hexahedron"),
    "blocks": lambda: on_one_another(Coulomb(0.38), "hexahedron"),
    "blocks, tetrahedra": lambda: on_one_another(Coulomb(0.38), "tetrahedron"),
    "plane blocks by mortar": lambda: by_mortar(on_block(Coulomb(0.38), "triangle", 2)),
    "blocks by mortar": lambda: on_one_another(Coulomb(0.38), "hexahedron", "mortar"),
    "blocks by mortar, tetrahedra": lambda: on_one_another(Tresca(0.8), "tetrahedron", "mortar"),
}
OBJECTIVES = objectives("block")


@cache
def line(name: str) -> Line:
    return line_of(SCENES[name]())
