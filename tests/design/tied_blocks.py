"""A block on a floor with another one tied on top, whose tied surfaces are designs, too."""

from __future__ import annotations

from collections.abc import Callable
from functools import cache

import numpy as np

from fenics_contact import (
    Body,
    BodyForce,
    BodyMesh,
    ContactPair,
    Coulomb,
    Scene,
    Support,
    Surface,
    Tie,
    Traction,
)
from fenics_contact.gallery import block, rectangle
from fenics_contact.materials import IsotropicElasticity, PlaneStrain
from fenics_contact.mesh import quadratic
from tests.design.objectives import objectives
from tests.design.plane_blocks import FLOOR as GROUND
from tests.design.plane_blocks import line_of
from tests.design.quotients import Line
from tests.scenes import FLOOR, crowned


def _boxes(cell: str) -> tuple[BodyMesh, BodyMesh]:
    """The block and the one on top, which does not match it and reaches beyond it nowhere."""
    if cell in ("quadrilateral", "triangle"):
        lower, upper = (0.0, 0.0), (2.0, 1.0)
        return rectangle(lower, upper, (7, 3), cell), rectangle((0.12, 1.0), (1.85, 1.8), (5, 2), cell)
    lower_block = block((0.0, 0.0, 0.0), (2.0, 1.0, 1.0), (5, 3, 2), cell)
    return lower_block, block((0.12, 0.08, 1.0), (1.85, 0.91, 1.6), (4, 3, 1), cell)


def capped(cell: str, *, sliding: bool = False, order: int = 1, discretisation: str = "node") -> Scene:
    """A crowned block that a floor holds, and a cap on its rounded top that is pressed."""
    below, above = (quadratic(mesh) if order == 2 else mesh for mesh in _boxes(cell))
    below, dim = crowned(below, 0.02), below.dim
    # Both sides of the tie are bent alike, so that normals differ along it.
    below, above = (
        mesh.moved(
            mesh.points - 0.1 * ((mesh.points[:, :1] - 1.0) ** 2 * mesh.points[:, -1:]) * np.eye(dim)[-1]
        )
        for mesh in (below, above)
    )
    top, bottom = ("z1", "z0") if dim == 3 else ("y1", "y0")
    stuff = IsotropicElasticity if dim == 3 else PlaneStrain
    push = 0.0 if sliding else 0.3
    held = Support("cap", "x0", (0.0, *(None,) * (dim - 1)))
    across = [] if dim == 2 else [Support("cap", "y0", (None, 0.0, None))]
    floor = FLOOR if dim == 3 else GROUND
    return Scene(
        {"block": Body(below, stuff(100.0, 0.3)), "cap": Body(above, stuff(150.0, 0.2))},
        [held, *across] if sliding else [],
        [
            Traction("cap", top, (push, *(0.1,) * (dim - 2), -2.0)),
            BodyForce("block", (0.05, *(0.0,) * (dim - 1))),
        ],
        [ContactPair(Surface("block", bottom), floor, Coulomb(0.3))],
        [Tie(Surface("cap", bottom), Surface("block", top), sliding, discretisation)],
    )


SCENES: dict[str, Callable[[], Scene]] = {
    "plane": lambda: capped("quadrilateral"),
    "plane, sliding": lambda: capped("triangle", sliding=True),
    "plane, quadratic": lambda: capped("triangle", order=2),
    "bonded": lambda: capped("hexahedron"),
    "sliding": lambda: capped("tetrahedron", sliding=True),
    "bonded by mortar": lambda: capped("hexahedron", discretisation="mortar"),
    "sliding by mortar": lambda: capped("hexahedron", sliding=True, discretisation="mortar"),
    "plane, sliding by mortar": lambda: capped("triangle", sliding=True, discretisation="mortar"),
    "sliding, quadratic": lambda: capped("tetrahedron", sliding=True, order=2),
}
OBJECTIVES = objectives("cap")


@cache
def line(name: str) -> Line:
    scene = SCENES[name]()
    (tie,) = scene.ties
    # Normals of sliding ties are the master's, by mortar the slave's.
    also = [tie.master] if "sliding" in name and "mortar" not in name else [tie.slave, tie.master]
    return line_of(scene, 7, also)
