"""Estimates that must not depend on the number of ranks: run it under mpirun, or call `collect`."""

from __future__ import annotations

import json
import sys
from typing import Any

import numpy as np
from mpi4py import MPI

from fenics_contact import Body, Scene, box_partition
from fenics_contact._accuracy.discretisation import discretisation_error
from fenics_contact.feti import build_torn_system, decompose
from fenics_contact.materials import IsotropicElasticity
from fenics_contact.mesh import bisection_partition
from tests.accuracy.fields import quadratic, torn_field
from tests.materials.bodies import bent, box, in_halves

SOFT, STIFF = IsotropicElasticity(100.0, 0.3), IsotropicElasticity(300.0, 0.2)


def two_bodies() -> Scene:
    """Hexahedra in two materials, and tetrahedra in a plate one cell thick."""
    return Scene(
        {
            "mixed": Body(bent(in_halves(box("hexahedron", (6, 3, 3)))), {"left": SOFT, "right": STIFF}),
            "plate": Body(bent(box("tetrahedron", (6, 4, 1))), SOFT),
        }
    )


def cuts(scene: Scene) -> dict[str, dict[str, np.ndarray]]:
    meshes = {name: body.mesh for name, body in scene.bodies.items()}
    return {
        "boxes": {name: box_partition(mesh, (3, 1, 1)) for name, mesh in meshes.items()},
        "bisection": {name: bisection_partition(mesh, 5) for name, mesh in meshes.items()},
    }


def collect(comm: MPI.Comm) -> dict[str, Any]:
    """Collective on ``comm``."""
    scene, found = two_bodies(), {}
    field, _ = quadratic(3)
    for name, partitions in cuts(scene).items():
        torn = build_torn_system(scene, decompose(scene, partitions, comm))
        # Cubic, and torn apart a little: the mean of the copies counts.
        displacement = torn_field(torn, lambda points: field(points) * (1 + points[:, :1]))
        shift = np.repeat([1e-6 * mesh.number for mesh in torn.decomposition.meshes], 3)
        sizes = [len(mesh.nodes) for mesh in torn.decomposition.meshes]
        displacement += np.repeat(shift.reshape(-1, 3), sizes, axis=0).ravel()
        estimate = discretisation_error(torn, displacement)
        cells = {body: estimate.by_cell(body).tolist() for body in scene.bodies}
        found[name] = {"total": estimate.total, "by body": dict(estimate.by_body), "by cell": cells}
    return {"ranks": comm.size, "found": found}


if __name__ == "__main__":
    answer = collect(MPI.COMM_WORLD)
    if MPI.COMM_WORLD.rank == 0:
        json.dump(answer, sys.stdout)
