"""Scenes of rubber."""

from __future__ import annotations

from dataclasses import replace

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
    box_partition,
)
from fenics_contact.gallery import block
from fenics_contact.materials import NeoHooke

RUBBER = NeoHooke(1.0, 0.3)


def rounded(cells: int, cell: str = "hexahedron") -> BodyMesh:
    """A unit cube whose lower face bulges downwards in its middle."""
    mesh = block((0, 0, 0), (1, 1, 1), (cells,) * 3, cell)
    x, y, z = mesh.points.T
    height = z + 0.15 * ((x - 0.5) ** 2 + (y - 0.5) ** 2) * (1 - z)
    return replace(mesh, points=np.column_stack([x, y, height]))


def pressed(mesh: BodyMesh, depth: float, pushed: float = 0.0, friction: float = 0.5) -> Scene:
    """A block pressed on a plane and pushed along it."""
    pair = ContactPair(
        Surface("block", "z0"), RigidPlane((0, 0, 0), (0, 0, 1)), Coulomb(friction) if friction else None
    )
    return Scene(
        {"block": Body(mesh, RUBBER)}, [Support("block", "z1", (pushed, 0.0, -depth))], contacts=[pair]
    )


def cut(mesh: BodyMesh, pieces: int) -> dict[str, np.ndarray]:
    return {"block": box_partition(mesh, (pieces,) * 3)}


def tilted(angle: float) -> np.ndarray:
    """A rotation about no axis of the mesh."""
    axis = np.array([1.0, 2.0, 2.0]) / 3.0
    cross = np.cross(np.eye(3), axis)
    return np.asarray(np.eye(3) - np.sin(angle) * cross + (1 - np.cos(angle)) * cross @ cross)
