"""A wedge between two rigid walls, and its load histories."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from mpi4py import MPI

from fenics_contact import (
    Body,
    ContactPair,
    ContactProblem,
    Coulomb,
    LoadSequence,
    LoadStep,
    RigidPlane,
    Scene,
    State,
    Surface,
    TotalForce,
)
from fenics_contact.gallery import rectangle
from fenics_contact.materials import PlaneStrain
from fenics_contact.mesh import bisection_partition
from tests.scenes import Load

FRICTION = 0.3


def driven(force: float) -> list[Load]:
    return [TotalForce("wedge", "y1", (0.0, -force))]


def wedge(degrees: float, friction: float = FRICTION) -> Scene:
    """A wedge whose sides are inclined, held by friction alone, of cells that are no mirror images."""
    angle = np.radians(degrees)
    base = rectangle((-1.0, 1.0), (1.0, 6.0), (3, 5))
    share, height = base.points.T
    mesh = base.moved(np.column_stack([share * (2.0 + height * np.tan(angle)), height]))
    c, s = np.cos(angle), np.sin(angle)
    walls = {"x1": RigidPlane((2.0, 0.0), (-c, s)), "x0": RigidPlane((-2.0, 0.0), (c, s))}
    pairs = [ContactPair(Surface("wedge", side), wall, Coulomb(friction)) for side, wall in walls.items()]
    return Scene({"wedge": Body(mesh, PlaneStrain(1000.0, 0.3))}, [], driven(1.0), pairs)


def follow(scene: Scene, forces: Sequence[float], pieces: int = 3, **options: object) -> list[State]:
    mesh = scene.bodies["wedge"].mesh
    problem = ContactProblem(
        scene, MPI.COMM_SELF, partitions={"wedge": bisection_partition(mesh, pieces)},
        **({"tolerance": 1e-8} | options if "solver" not in options else options),
    )  # fmt: skip
    steps = LoadSequence(problem)
    return [steps.advance(LoadStep(f"{force:g}", loads=driven(force))) for force in forces]
