"""Small scenes for the tests of the lower floors: skewed blocks, alone or in contact."""

from __future__ import annotations

from typing import Any

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
from fenics_contact.gallery import block
from fenics_contact.materials import IsotropicElasticity
from fenics_contact.mesh import bisection_partition

CELLS = ("hexahedron", "tetrahedron")
STEEL = IsotropicElasticity(210.0, 0.3)
RUBBER = IsotropicElasticity(5.0, 0.45)

Cut = tuple[Scene, dict[str, np.ndarray]]


def skewed(mesh: BodyMesh, size: float = 0.05) -> BodyMesh:
    """Bend the mesh smoothly, so that no cell is a brick and no face but the lowest stays plane."""
    x, y, z = mesh.points.T
    bent = np.column_stack([x + size * np.sin(3 * y) * z, y - size * np.cos(2 * x) * z, z + size * x * y * z])
    return mesh.moved(bent)


def lone_block(cell: str, boxes: tuple[int, int, int] = (2, 2, 2), layers: int = 2, **parts: Any) -> Cut:
    """One bent block in boxes of ``layers`` cells each way; supports and loads are the caller's."""
    counts = tuple(layers * n for n in boxes)
    straight = block((0, 0, 0), (1.0, 1.2, 0.9), counts, cell)
    return Scene({"block": Body(skewed(straight), STEEL)}, **parts), {"block": box_partition(straight, boxes)}


def ragged_block(cell: str, parts: int = 5, **more: Any) -> Cut:
    """One bent block in subdomains that are no boxes."""
    straight = block((0, 0, 0), (1.0, 1.2, 0.9), (3, 4, 3), cell)
    return Scene({"block": Body(skewed(straight), STEEL)}, **more), {
        "block": bisection_partition(straight, parts)
    }


def clamped_block(cell: str, boxes: tuple[int, int, int] = (2, 2, 2), layers: int = 2) -> Cut:
    """A bent block that is clamped below, pulled at the top and drawn by its weight."""
    return lone_block(
        cell,
        boxes,
        layers,
        supports=[Support("block", "z0")],
        loads=[Traction("block", "z1", (0.3, 0.1, 1.0)), BodyForce("block", (0.0, 0.5, -2.0))],
    )


def sliding_block() -> Cut:
    """A clamped block in sixteen cubes that is pressed on a plane and dragged over it with friction."""
    mesh = block((0, 0, 0), (2, 1, 1), (8, 4, 4))
    scene = Scene(
        {"block": Body(mesh, IsotropicElasticity(1.0, 0.3))},
        [Support("block", "x0")],
        [Traction("block", "z1", (-0.01, -0.007, -0.04))],
        [ContactPair(Surface("block", "z0"), RigidPlane((0, 0, -0.01), (0, 0, 1)), Coulomb(0.3))],
    )
    return scene, {"block": box_partition(mesh, (4, 2, 2))}


def three_that_meet(mesh: BodyMesh, x: float, y: float) -> np.ndarray:
    """Cut a mesh into three subdomains that meet along a line upright."""
    east, north = (mesh.points[mesh.cells].mean(axis=1)[:, :2] > (x, y)).T
    return np.where(east, 1 + north, 0)


def touching_blocks() -> Cut:
    """Three blocks: tetrahedra upon hexahedra with meshes that do not match, and hexahedra on a floor.

    Subdomain boundaries of slave and master cross the contact surfaces; one pair has Coulomb friction, one
    Tresca friction, one none.
    """
    lower = block((0, 0, 0), (2, 2, 1), (4, 4, 2))
    upper = block((0.1, 0.2, 1), (1.7, 1.8, 2), (3, 5, 2), "tetrahedron")
    third = block((2.2, 0, 0.01), (3, 1, 1), (2, 2, 2))
    floor = RigidPlane((0, 0, 0), (0.1, 0, 1))
    return Scene(
        {"lower": Body(lower, STEEL), "upper": Body(upper, RUBBER), "third": Body(third, STEEL)},
        supports=[Support("lower", "z0"), Support("upper", "y0", (0.05, None, None))],
        loads=[Traction("upper", "z1", (0.02, 0.01, -0.3)), BodyForce("third", (0.1, 0.0, -2.0))],
        contacts=[
            ContactPair(Surface("upper", "z0"), Surface("lower", "z1"), Coulomb(0.3), discretisation="node"),
            ContactPair(Surface("third", "z0"), floor, Tresca(0.4)),
            ContactPair(Surface("third", "x0"), Surface("lower", "x1"), discretisation="node"),
        ],
    ), {
        "lower": box_partition(lower, (2, 2, 1)),
        "upper": three_that_meet(upper, 0.64, 0.85),
        "third": box_partition(third, (2, 1, 1)),
    }
