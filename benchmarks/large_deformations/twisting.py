"""A hollow half sphere pressed into a block with friction, and twisted: its moment, beside published ones.

R. A. Sauer, L. De Lorenzis, An unbiased computational contact formulation for 3D friction, Int. J. Numer.
Methods Eng. 101 (2015); B. K. Zimmerman, G. A. Ateshian, A surface-to-surface finite element algorithm for
large deformation frictional contact in FEBio, J. Biomech. Eng. 140 (2018).
"""

from __future__ import annotations

from time import perf_counter
from typing import Any

import numpy as np
from mpi4py import MPI

from fenics_contact import (
    AutomaticSteps,
    Body,
    BodyMesh,
    ContactPair,
    ContactProblem,
    Coulomb,
    LoadSequence,
    LoadStep,
    RigidSurface,
    Scene,
    Support,
    Surface,
)
from fenics_contact.gallery import box_lattice, growing_ticks
from fenics_contact.materials import NeoHooke
from fenics_contact.mesh import boundary_faces
from fenics_contact.shapes import Sphere

#: Edge of the block, radii of the half sphere, and how deep it is pressed in, [length].
EDGE, OUTER, INNER, DEPTH = 2.0, 1.0, 2.0 / 3.0, 1.0
#: Young's moduli of half sphere and block, Poisson's ratio, friction.
HARD, SOFT, RATIO, FRICTION = 50.0, 10.0, 0.3, 0.5
#: Load steps until it is pressed in, then the angles at their ends, in degrees.
PRESSING, ANGLES = 5, (10, 20, 30, 45, 60, 75, 90, 105, 120, 135, 150, 165, 175)
#: Published moments, read from figures to about 1 %: by angle, of Sauer and De Lorenzis and by FEBio.
PUBLISHED = {
    10: (0.757, 0.734),
    20: (1.455, 1.443),
    30: (2.087, 2.117),
    45: (2.926, 2.968),
    60: (3.545, 3.578),
    90: (3.991, 4.017),
    120: (4.026, 4.098),
    150: (4.061, 4.073),
    175: (4.018, 4.048),
}
#: Columns of facets from side to side of the half sphere, by those of the block.
COLUMNS = {8: 6, 12: 10, 16: 16}
#: Length of a layer of the block by that of the one above, where it has 8 columns.
GROWTH = 1.3


def half_sphere(columns: int) -> BodyMesh:
    """Mesh it with its pole at the origin: the skin of half a cube, spread over shells."""
    half = columns // 2
    even = np.linspace(-1.0, 1.0, columns + 1)
    cube = box_lattice([even, even, even[: half + 1]])
    skin = np.concatenate([cube.surfaces[side] for side in ("z0", "x0", "x1", "y0", "y1")])
    nodes, quads = np.unique(skin, return_inverse=True)
    quads = quads.reshape(skin.shape)
    ray = np.tan(0.25 * np.pi * cube.points[nodes])
    ray /= np.linalg.norm(ray, axis=1)[:, None]
    radii = np.linspace(INNER, OUTER, max(2, half // 2) + 1)
    points = (radii[:, None, None] * ray).reshape(-1, 3)
    shells = len(nodes) * np.arange(len(radii))[:, None, None] + quads
    cells = np.concatenate([shells[:-1], shells[1:]], axis=2).reshape(-1, 8)
    facets, _ = boundary_faces(cells)
    at = points[facets]
    sides = {
        "outside": facets[np.all(np.linalg.norm(at, axis=2) > OUTER - 1e-9, axis=1)],
        "top": facets[np.all(np.abs(at[:, :, 2]) < 1e-9, axis=1)],
    }
    centre = np.array((0.0, 0.0, OUTER))
    return BodyMesh(points + centre, cells, sides, shapes={"outside": Sphere((0.0, 0.0, OUTER), OUTER)})


def block(columns: int) -> BodyMesh:
    """Mesh the block below it, whose layers grow downwards."""
    across = np.linspace(-0.5 * EDGE, 0.5 * EDGE, columns + 1)
    down = growing_ticks(EDGE, EDGE / columns, GROWTH ** (8.0 / columns))
    return box_lattice([across, across, -down[::-1]])


def twisted(columns: int) -> Scene:
    """Return the scene at rest: mortar contact, nodes of the block are the slaves."""
    bodies = {
        "block": Body(block(columns), NeoHooke(SOFT, RATIO)),
        "sphere": Body(half_sphere(COLUMNS[columns]), NeoHooke(HARD, RATIO)),
    }
    pair = ContactPair(Surface("block", "z1"), Surface("sphere", "outside"), Coulomb(FRICTION), "mortar")
    return Scene(bodies, held(0.0, 0.0), contacts=[pair])


def held(depth: float, degrees: float) -> list[Support | RigidSurface]:
    """Return the supports with the half sphere's rim pressed down and turned about the vertical axis."""
    turned = RigidSurface("sphere", "top", (0, 0, 0), (0, 0, -depth), (0, 0, np.radians(degrees)))
    return [Support("block", "z0"), turned]


def measured(comm: MPI.Comm, columns: int, last: int = ANGLES[-1]) -> dict[str, Any]:
    """Return forces and moments for one of `COLUMNS`, at the angles up to the last one."""
    scene = twisted(columns)
    # Parts of steps, which the finest mesh needs, are steps of friction, too.
    sequence = LoadSequence(ContactProblem(scene, comm, steps=AutomaticSteps(finer_history=True)))
    pressing = [(DEPTH * part / PRESSING, 0) for part in range(1, PRESSING + 1)]
    began, found = perf_counter(), list[dict[str, float]]()
    for depth, angle in [*pressing, *((DEPTH, angle) for angle in ANGLES if angle <= last)]:
        state = sequence.advance(LoadStep(f"{depth:g} deep, {angle} degrees", supports=held(depth, angle)))
        below, above = state.reactions()
        found.append(
            {
                "depth": depth,
                "angle": angle,
                "force": round(float(below.force[2]), 4),
                "moment": round(float(np.asarray(above.moment)[2]), 4),
                "newton_steps": len(state.solution.history),
                "products": state.solution.products,
            }
        )
    return {
        "columns": columns,
        "dofs": 3 * sum(body.mesh.n_nodes for body in scene.bodies.values()),
        "steps": found,
        "seconds": round(perf_counter() - began, 1),
    }
