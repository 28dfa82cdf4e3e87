"""A load history that is interrupted: ``step_cases.py FILE`` goes on from what is there."""

from __future__ import annotations

import json
import sys
from pathlib import Path
from typing import Any

import numpy as np
from mpi4py import MPI

from fenics_contact import (
    Body,
    Checkpoint,
    ContactPair,
    ContactProblem,
    Coulomb,
    LoadSequence,
    LoadStep,
    RigidPlane,
    Scene,
    State,
    Support,
    Surface,
    box_partition,
)
from fenics_contact.gallery import block
from fenics_contact.materials import IsotropicElasticity
from fenics_contact.qp import FaceNewton

FLOOR = RigidPlane((0.0, 0.0, 0.0), (0.0, 0.0, 1.0))
WALL = RigidPlane((0.0, 0.0, 0.0), (0.0, 1.0, 0.0))
#: Pressed, sheared until much slips, let go, sheared the other way.
PATH = (0.0, 0.006, 0.02, 0.008, 0.0, -0.02, -0.004)


def sheared_block() -> Scene:
    mesh = block((0.0, 0.0, 0.0), (2.0, 1.0, 1.0), (5, 3, 3))
    pairs = [
        ContactPair(Surface("block", "z0"), FLOOR, Coulomb(0.3)),
        ContactPair(Surface("block", "y0"), WALL),
    ]
    return Scene({"block": Body(mesh, IsotropicElasticity(1000.0, 0.3))}, contacts=pairs)


def shears(path: tuple[float, ...] = PATH) -> list[LoadStep]:
    """Top face pressed by a hundredth and shifted along x."""
    return [LoadStep(f"shift {s:g}", supports=[Support("block", "z1", (s, 0.0, -0.01))]) for s in path]


def sequence(checkpoint: Checkpoint | None, comm: MPI.Comm) -> LoadSequence:
    scene = sheared_block()
    cut = {"block": box_partition(scene.bodies["block"].mesh, (2, 1, 1))}
    return LoadSequence(
        ContactProblem(scene, comm, partitions=cut, solver=FaceNewton(tolerance=1e-11)), checkpoint=checkpoint
    )


def forces(state: State) -> np.ndarray:
    return state.contact.force


def collect(path: Path, comm: MPI.Comm) -> dict[str, Any]:
    """Run the whole path, from the checkpoint as far as it goes. Collective."""
    history = sequence(Checkpoint(path, resume=True), comm)
    states = [history.advance(step) for step in shears()]
    return {
        "ranks": comm.size,
        "forces": [forces(state).tolist() for state in states],
        "slip": [state.contact.total_slip.tolist() for state in states],
        "last slip": [state.contact.slip.tolist() for state in states],
        "products": [state.solution.products for state in states],
    }


if __name__ == "__main__":
    answer = collect(Path(sys.argv[1]), MPI.COMM_WORLD)
    if MPI.COMM_WORLD.rank == 0:
        sys.stdout.write(json.dumps(answer))
