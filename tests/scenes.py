"""Tiny scenes with everything in them: nodes that stick, nodes that slip, nodes that lift off.

Types of what scenes are made of are imported from here: they have no public names.
"""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from fenics_contact import (
    Body,
    BodyForce,
    BodyMesh,
    ContactPair,
    Coulomb,
    RigidPlane,
    Scene,
    Support,
    Surface,
    Traction,
    Tresca,
    box_partition,
)
from fenics_contact._scene.loads import Load as Load
from fenics_contact._scene.obstacles import RigidObstacle as RigidObstacle
from fenics_contact._scene.supports import AnySupport as AnySupport
from fenics_contact.gallery import block
from fenics_contact.materials import IsotropicElasticity

SOFT, STIFF = IsotropicElasticity(100.0, 0.3), IsotropicElasticity(300.0, 0.2)
FLOOR = RigidPlane((0.0, 0.0, 0.0), (0.0, 0.0, 1.0))
Friction = Coulomb | Tresca | None


def crowned(mesh: BodyMesh, rise: float) -> BodyMesh:
    """Bend the lower face of a block upwards towards its ends in x, most at the ends, not at all on top."""
    points = mesh.points.copy()
    low, high = points.min(axis=0), points.max(axis=0)
    along = 2 * (points[:, 0] - low[0]) / (high[0] - low[0]) - 1
    below = (high[-1] - points[:, -1]) / (high[-1] - low[-1])
    points[:, -1] += rise * along**2 * below
    return mesh.moved(points)


def block_on_plane(friction: Friction, cell: str = "hexahedron", *, push: float = 1.0) -> Scene:
    """A crowned block that only a rigid floor holds: pressed on top, pushed along x and a little along y.

    The push tips the block: its heel lifts off, its toe is pressed hardest. Load: 4 down, 2 ``push`` along x.
    """
    mesh = crowned(block((0.0, 0.0, 0.0), (2.0, 1.0, 1.0), (6, 3, 3), cell), 0.02)
    load = Traction("block", "z1", (push, 0.3 * push, -2.0))
    pair = ContactPair(Surface("block", "z0"), FLOOR, friction)
    return Scene({"block": Body(mesh, SOFT)}, loads=[load], contacts=[pair])


def two_blocks(friction: Friction, cell: str = "hexahedron", *, push: float = 0.6) -> Scene:
    """A crowned block pressed on another one whose mesh does not match; nothing else holds it."""
    lower = block((0.0, 0.0, -1.0), (2.0, 1.0, 0.0), (5, 3, 2), cell)
    upper = crowned(block((0.1, 0.05, 0.0), (1.9, 0.95, 0.8), (6, 4, 2), cell), 0.04)
    return Scene(
        {"lower": Body(lower, STIFF), "upper": Body(upper, SOFT)},
        [Support("lower", "z0")],
        [Traction("upper", "z1", (push, 0.2 * push, -2.0)), BodyForce("upper", (0.0, 0.0, -0.1))],
        [ContactPair(Surface("upper", "z0"), Surface("lower", "z1"), friction, discretisation="node")],
    )


def cornered_block(friction: Friction) -> Scene:
    """The block on the plane pushed against a rigid wall, with nodes on an edge that touch both.

    They have six contact multipliers for three displacements: their forces are not unique.
    """
    scene = block_on_plane(friction)
    wall = ContactPair(Surface("block", "x1"), RigidPlane((2.0, 0.0, 0.0), (-1.0, 0.0, 0.0)), friction)
    return replace(scene, contacts=[*scene.contacts, wall])


def pressed_block(friction: Friction, cell: str = "hexahedron", *, push: float = 0.01) -> Scene:
    """A crowned block on a rigid floor whose top is pressed down and dragged along x by a given way."""
    mesh = crowned(block((0.0, 0.0, 0.0), (2.0, 1.0, 1.0), (6, 3, 3), cell), 0.03)
    pair = ContactPair(Surface("block", "z0"), FLOOR, friction)
    support = Support("block", "z1", (push, 0.0, -0.025))
    return Scene({"block": Body(mesh, SOFT)}, [support], contacts=[pair])


def stack(upper: Friction, lower: Friction) -> Scene:
    """The two blocks, the lower one lying on a rigid floor with a friction law of its own: both float."""
    blocks = two_blocks(upper)
    floor = ContactPair(Surface("lower", "z0"), RigidPlane((0.0, 0.0, -1.0), (0.0, 0.0, 1.0)), lower)
    return replace(blocks, supports=[], contacts=[*blocks.contacts, floor])


def partitions(scene: Scene, boxes: tuple[int, int, int] = (2, 1, 1)) -> dict[str, np.ndarray]:
    """Cut every body into the same boxes."""
    return {name: box_partition(body.mesh, boxes[: scene.dim]) for name, body in scene.deforming.items()}


def guided(scene: Scene, body: str) -> Scene:
    """Keep one side of a body from moving along x and one along y: without friction it would slide."""
    guides = [Support(body, "x0", (0.0, None, None)), Support(body, "y0", (None, 0.0, None))]
    return replace(scene, supports=[*scene.supports, *guides])


def with_friction(scene: Scene, friction: Friction) -> Scene:
    """Return the scene with another friction law on every pair."""
    return replace(scene, contacts=[replace(pair, friction=friction) for pair in scene.contacts])
