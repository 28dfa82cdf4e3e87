"""Bodies of all shapes of cells pressed on each other with surfaces of triangles and quadrilaterals."""

from __future__ import annotations

import numpy as np
from mpi4py import MPI

from fenics_contact import Body, ContactPair, Coulomb, Scene, Support, Surface, Traction, solve_scene
from fenics_contact.materials import IsotropicElasticity, NeoHooke
from fenics_contact.mesh import bisection_partition
from fenics_contact.mesh.body_mesh import BodyMesh
from tests.fem.mixed_cells import mixed_bar

UPPER, LOWER = Surface("upper", "z0"), Surface("lower", "z1")


def wavy(mesh: BodyMesh, size: float = 1.0) -> BodyMesh:
    """Shift nodes alike on all levels, so that no quadrilateral of the levels is a parallelogram."""
    points, (x, y) = mesh.points.copy(), mesh.points.T[:2]
    points[:, 0] += 0.1 * size * np.sin(np.pi * x) * np.sin(np.pi * y) * x * (2 - x)
    points[:, 1] += 0.12 * size * np.sin(np.pi * x / 2) * np.sin(np.pi * y) * (y - 0.3)
    return mesh.moved(points)


def raised(mesh: BodyMesh, height: float = 1.0) -> BodyMesh:
    return mesh.moved(mesh.points + np.array([0.0, 0.0, height]))


def pressed(lower: BodyMesh, upper: BodyMesh, pair: object, much: bool = False) -> Scene:
    """Press the upper bar on the lower one by 1, or where they deform much by 5 percent of their modulus."""
    soft = NeoHooke(100.0, 0.0) if much else IsotropicElasticity(100.0, 0.0)
    return Scene(
        {"lower": Body(lower, soft), "upper": Body(upper, soft)},
        [
            Support("lower", "z0"),
            Support("upper", "x0", (0.0, None, None)),
            Support("upper", "y0", (None, 0.0, None)),
        ],
        [Traction("upper", "z1", (0.0, 0.0, -5.0 if much else -1.0))],
        **{"contacts" if isinstance(pair, ContactPair) else "ties": [pair]},
    )


def displacement_on(comm: MPI.Comm) -> list[list[float]]:
    """Return the displacement of a bar that is pulled over another one with friction. Collective."""
    lower, upper = wavy(mixed_bar()), raised(wavy(mixed_bar(), -0.5))
    pair = ContactPair(UPPER, LOWER, Coulomb(0.3), discretisation="mortar")
    soft = IsotropicElasticity(100.0, 0.3)
    scene = Scene(
        {"lower": Body(lower, soft), "upper": Body(upper, soft)},
        [Support("lower", "z0"), Support("upper", "z1", (0.01, 0.002, -0.02))],
        contacts=[pair],
    )
    partitions = {"lower": bisection_partition(lower, 5), "upper": bisection_partition(upper, 4)}
    state = solve_scene(scene, comm, partitions=partitions, tolerance=1e-11)
    return [row.tolist() for name in ("lower", "upper") for row in state.gather_displacement(name)]
