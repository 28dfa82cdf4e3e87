"""Errors of a state against the theory of Hertz."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from mpi4py import MPI

from fenics_contact import (
    Body,
    BodyMesh,
    ContactPair,
    RigidPlane,
    Scene,
    State,
    Support,
    Surface,
    TotalForce,
    solve_scene,
)
from fenics_contact.materials import IsotropicElasticity
from fenics_contact.mesh import bisection_partition
from fenics_contact.qp import FaceNewton
from tests.equilibrium.checks import assert_solved

YOUNG, POISSON = 1000.0, 0.3


@dataclass(frozen=True)
class Hertz:
    """Theory for radius 1: half-width a of the contact, peak pressure p0 and force."""

    radius: float
    peak: float
    force: float


def errors(state: State, theory: Hertz, axes: Sequence[int], moment: float) -> tuple[float, float]:
    """Return the relative errors of peak pressure and contact radius."""
    contact = state.contact
    distance = np.linalg.norm(state.scene.bodies["body"].mesh.points[contact.points.slave][:, axes], axis=1)
    closed = np.flatnonzero(contact.normal_force > 0)
    assert len(closed) >= 2
    assert len(closed) < contact.points.count
    assert distance[closed].max() < 3 * theory.radius
    peak = contact.pressure[np.argmin(distance)]
    radius = np.sqrt(contact.normal_force @ distance**2 / contact.normal_force.sum() / moment)
    return peak / theory.peak - 1, radius / theory.radius - 1


PLANE_STRAIN = YOUNG / (1 - POISSON**2)


LENGTH = 0.05


FLOOR = RigidPlane((0.0, 0.0, 0.0), (0.0, 0.0, 1.0))


TOLERANCE = 1e-5


def cylinder(radius: float) -> Hertz:
    force = np.pi * PLANE_STRAIN * radius**2 / 4
    return Hertz(radius, 2 * force / (np.pi * radius), force)


def edge(grading: float) -> float:
    """Return how far from the axis the mesh with n = 4 has its first node, a quarter of the way out."""
    return float(np.sin(np.pi / 4 * np.expm1(grading / 4) / np.expm1(grading)))


def pressed(mesh: BodyMesh, guides: dict[str, tuple[float | None, ...]], force: float) -> State:
    scene = Scene(
        {"body": Body(mesh, IsotropicElasticity(YOUNG, POISSON))},
        [Support("body", side, value) for side, value in guides.items()],
        [TotalForce("body", "top", (0.0, 0.0, -force))],
        [ContactPair(Surface("body", "contact"), FLOOR)],
    )
    parts = {"body": bisection_partition(mesh, max(2, mesh.n_cells // 500))}
    state = solve_scene(scene, MPI.COMM_SELF, partitions=parts, solver=FaceNewton(tolerance=TOLERANCE))
    assert_solved(state, TOLERANCE)
    return state
