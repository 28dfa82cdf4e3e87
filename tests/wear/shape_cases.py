"""Scenes whose shape follows their wear."""

from __future__ import annotations

from dataclasses import replace
from typing import Any

from fenics_contact import (
    Body,
    ContactPair,
    RigidPlane,
    RigidSphere,
    Scene,
    Support,
    Surface,
    Wear,
)
from fenics_contact.gallery import block, half_disc, rectangle
from fenics_contact.materials import IsotropicElasticity, PlaneStrain
from fenics_contact.mesh import quadratic

PLANE = PlaneStrain(2000.0, 0.3)
WAY = Wear(3e-4, sliding=1.0)


def blocks(
    share: float,
    cells: tuple[int, int] = (8, 5),
    curved: bool = False,
    material: Any = PLANE,
    revolved: bool = False,
    **pair: Any,
) -> Scene:
    """Return two blocks, of which the upper one is pressed down, more on its left side."""
    low, high = rectangle((0.0, 0.0), (4.0, 1.0), (8, 4)), rectangle((0.0, 1.0), (4.0, 2.0), cells)
    meshes = {"low": low, "high": high}
    bodies = {
        name: Body(quadratic(mesh) if curved else mesh, material, axisymmetric=revolved)
        for name, mesh in meshes.items()
    }
    wear = replace(WAY, share=share)
    touching = ContactPair(Surface("high", "y0"), Surface("low", "y1"), wear=wear, **pair)
    sides = [Support(name, side, (0.0, None)) for name in bodies for side in ("x0", "x1")]
    down = Support("high", "y1", (None, lambda x: -0.04 + 0.005 * x[:, 0]))
    return Scene(bodies, [Support("low", "y0", (None, 0.0)), down, *sides], contacts=[touching])


def on_obstacle(obstacle: Any, share: float = 1.0, **pair: Any) -> Scene:
    """Return a block pressed on an obstacle."""
    body = Body(rectangle((-4.0, 0.0), (4.0, 4.0), (16, 8)), PLANE)
    touching = ContactPair(Surface("punch", "y0"), obstacle, wear=replace(WAY, share=share), **pair)
    return Scene({"punch": body}, [Support("punch", "y1", (0.0, -0.05))], contacts=[touching])


def cube(kind: str = "hexahedron", curved: bool = False) -> Scene:
    """Return a quarter of a block on a ball, with two planes of symmetry."""
    mesh = block((0.0, 0.0, 0.0), (2.0, 2.0, 1.0), (3, 3, 2), kind)
    body = Body(quadratic(mesh) if curved else mesh, IsotropicElasticity(2000.0, 0.3))
    held = [
        Support("cube", "x0", (0.0, None, None)),
        Support("cube", "y0", (None, 0.0, None)),
        Support("cube", "z1", (0.0, 0.0, -0.1)),
    ]
    ball = RigidSphere((0.0, 0.0, -20.0), 20.0)
    return Scene({"cube": body}, held, contacts=[ContactPair(Surface("cube", "z0"), ball, wear=WAY)])


def tilted(friction: Any, sliding: float | None = 1.0) -> Scene:
    """Return a block pressed on a plane, more on one side."""
    scene = on_obstacle(RigidPlane((0.0, 0.0), (0.0, 1.0)), friction=friction)
    pair = replace(scene.contacts[0], wear=Wear(5e-3 if sliding is None else 3e-4, sliding=sliding))
    down = Support("punch", "y1", (0.0, lambda x: -0.05 + 0.002 * x[:, 0]))
    return replace(scene, contacts=[pair], supports=[down])


def disc_on_plane(*supports: Support, deep: float = 0.01) -> Scene:
    """Return half of a disc that is pressed on a plane, and whose contact surface has a true shape."""
    mesh = half_disc(1.0, 8)
    pair = ContactPair(Surface("disc", "contact"), RigidPlane((0.0, 0.0), (0.0, 1.0)), wear=WAY)
    held = [Support("disc", "x0", (0.0, None)), Support("disc", "top", (None, -deep)), *supports]
    return Scene({"disc": Body(mesh, PLANE)}, held, contacts=[pair])
