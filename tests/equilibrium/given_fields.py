"""A block with friction given as a field; run as a script, it prints its contact forces."""

from __future__ import annotations

import json

import numpy as np
from mpi4py import MPI

from fenics_contact import (
    Body,
    ContactPair,
    Coulomb,
    RigidPlane,
    SampledField,
    Scene,
    Support,
    Surface,
    solve_scene,
)
from fenics_contact.gallery import block
from fenics_contact.materials import IsotropicElasticity
from tests.scenes import Friction

MESH = block((0, 0, 0), (4, 1, 1), (8, 2, 2))
FLOOR = RigidPlane((0, 0, 0), (0, 0, 1))
NODES = MESH.points[np.unique(MESH.surfaces["z0"])]


def shifted(friction: Friction) -> Scene:
    """Return a block that is pressed on the floor and shifted so far that all of it slips."""
    return Scene(
        {"block": Body(MESH, IsotropicElasticity(1.0, 0.0))},
        supports=[Support("block", "z1", (0.5, 0.0, -0.05))],
        contacts=[ContactPair(Surface("block", "z0"), FLOOR, friction)],
    )


def rising(x: np.ndarray) -> np.ndarray:
    return 0.1 + 0.05 * x[:, 0]


def forces(comm: MPI.Comm) -> np.ndarray:
    law = Coulomb(SampledField(NODES, rising(NODES)))
    return solve_scene(shifted(law), comm, tolerance=1e-9).contact.force


if __name__ == "__main__":
    found = forces(MPI.COMM_WORLD)
    if MPI.COMM_WORLD.rank == 0:
        print(json.dumps(found.tolist()))
