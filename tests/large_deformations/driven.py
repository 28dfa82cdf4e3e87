"""Rigid tools and rigid surfaces on rubber that forces, moments and springs move."""

from __future__ import annotations

import numpy as np

from fenics_contact import (
    Body,
    BodyMesh,
    ContactPair,
    Coulomb,
    RigidPlane,
    RigidSphere,
    RigidSurface,
    RigidTool,
    Scene,
    Support,
    Surface,
    ToolMotion,
)
from fenics_contact.gallery import block, disc, rectangle
from fenics_contact.materials import Material, NeoHooke

SOFT = NeoHooke(100.0, 0.3)
BASE = Support("block", "y0")
DISC = RigidTool("disc", RigidSphere((1.0, 4.0), 3.0), at=(1.0, 1.0))
FLAT = RigidTool("disc", RigidPlane((0.0, 1.0), (0.0, -1.0)), at=(0.9, 1.0))
PLATE = RigidTool("plate", RigidPlane((0, 0, 0), (0, 0, -1)), at=(0.2, 0.1, 0.0))


def under_disc(
    *motions: ToolMotion, friction: float = 0.5, tool: RigidTool = DISC, material: Material = SOFT
) -> Scene:
    """A plane block of rubber under a rigid disc."""
    mesh = rectangle((0, 0), (2, 1), (8, 4))
    pair = ContactPair(Surface("block", "y1"), tool, Coulomb(friction))
    return Scene({"block": Body(mesh, material)}, [BASE, *motions], contacts=[pair])


def under_plate(*motions: ToolMotion, material: Material = SOFT) -> Scene:
    """A block of rubber under a rigid plane."""
    body = Body(block((-1, -1, -1), (1, 1, 0), (4, 4, 2)), material)
    pair = ContactPair(Surface("block", "z1"), PLATE, Coulomb(0.3))
    return Scene({"block": body}, [Support("block", "z0"), *motions], contacts=[pair])


def roller(hub: RigidSurface, n: int = 3, friction: float = 0.0, turn: np.ndarray | None = None) -> Scene:
    """A ring of rubber around a rigid hub on a plane, all of it turned."""
    turn, mesh = np.eye(2) if turn is None else turn, disc(2.0, n, hole=1.0)
    turned = BodyMesh(mesh.points @ turn.T, mesh.cells, mesh.surfaces)
    plane = RigidPlane(tuple(turn @ (0.0, -2.0)), tuple(turn @ (0.0, 1.0)))
    pair = ContactPair(Surface("ring", "outer"), plane, Coulomb(friction))
    return Scene({"ring": Body(turned, NeoHooke(1.0, 0.4))}, [hub], contacts=[pair])


def hub(**driven: object) -> RigidSurface:
    """The bore of the ring as a rigid surface about its middle."""
    return RigidSurface("ring", "inner", (0.0, 0.0), **driven)  # type: ignore[arg-type]
