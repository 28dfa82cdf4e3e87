"""The profile of a roller, as in its demo on a coarser mesh: eight variables along the axis."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
from mpi4py import MPI

from fenics_contact import (
    Body,
    BodyMesh,
    ContactPair,
    ContactProblem,
    RigidPlane,
    RigidSurface,
    Scene,
    ShapeProblem,
    Support,
    Surface,
    SurfaceDesign,
)
from fenics_contact.design import AdaptiveTolerance, LargestPressure
from fenics_contact.gallery import box_lattice, growing_ticks, side_of
from fenics_contact.materials import IsotropicElasticity
from fenics_contact.theory import contact_modulus, hertz_line

#: Radius, Hertz's half width and length of the roller, [mm].
ROLLER = (10.0, 0.1, 10.0)
STEEL = IsotropicElasticity(young_modulus=2.06e5, poisson_ratio=0.3)
MODULUS = contact_modulus(2.06e5, 0.3, np.inf, 0.3)
LINE_LOAD = np.pi * MODULUS * ROLLER[1] ** 2 / (4 * ROLLER[0])
PEAK = hertz_line(LINE_LOAD, 1 / ROLLER[0], MODULUS).peak_pressure
#: A = w / (π E*), in which the relief is counted, [mm].
RELIEF = LINE_LOAD / (np.pi * MODULUS)


def _quarter() -> BodyMesh:
    """Mesh a quarter of a block under a cylindrical crown; "track" is what may touch."""
    radius, half_width, length = ROLLER
    far, wide = 2 * length, 1.5 * half_width
    x = np.append(np.linspace(0, wide, 4), wide + growing_ticks(far, half_width, 2.0)[1:])
    y = length / 2 - growing_ticks(length / 2, 1.5 * half_width, 1.4)[::-1]
    y = np.append(y, length / 2 + growing_ticks(far, 2.5 * half_width, 2.0)[1:])
    mesh = box_lattice([x, y, -growing_ticks(far, half_width, 2.0)[::-1]])
    points, top = mesh.points.copy(), mesh.surfaces["z1"]
    on = np.unique(top)[points[np.unique(top), 0] <= wide + 1e-9]
    points[on, 2] -= points[on, 0] ** 2 / (2 * radius)
    inside = (mesh.points[top][..., :2] <= [wide + 1e-9, length / 2 + 1e-9]).all(axis=(1, 2))
    return BodyMesh(points, mesh.cells, {**mesh.surfaces, "track": top[inside]})


def roller_shape_problem(
    comm: MPI.Comm, variables: int = 8, tolerance: float | AdaptiveTolerance | None = None
) -> ShapeProblem:
    """Pose the largest pressure of a roller on a rigid rail as a function of its profile. Collective.

    Args:
        comm: Communicator.
        variables: Number of coefficients along half of the axis, the first in the middle.
        tolerance: Of the states, as `ShapeProblem` takes it.
    """
    mesh, length = _quarter(), ROLLER[2]
    shaft = RigidSurface(
        "roller", "z0", (0, 0, 0), (0.0, 0.0, None), (0.0, 0.0, 0.0), force=(0, 0, LINE_LOAD * length / 4)
    )
    planes = [Support("roller", "x0", (0.0, None, None)), Support("roller", "y0", (None, 0.0, None))]
    rail = ContactPair(Surface("roller", "track"), RigidPlane((0, 0, 0), (0, 0, -1)))
    scene = Scene({"roller": Body(mesh, STEEL)}, [*planes, shaft], contacts=[rail])
    track = side_of(mesh, "track")
    ends = 2 / np.pi * np.arcsin(np.minimum(mesh.points[track.nodes, 1] / (length / 2), 1.0))
    surface = replace(track, parameters=np.column_stack([track.parameters[:, 0], ends]))
    design = SurfaceDesign("roller", surface, net=(1, variables))
    return ShapeProblem(ContactProblem(scene, comm), design, LargestPressure(), tolerance=tolerance)
