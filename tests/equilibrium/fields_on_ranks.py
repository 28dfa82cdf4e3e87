"""The fields of states that are solved as users solve them, on the ranks of a communicator; for the tests."""

from __future__ import annotations

import json
import sys
from collections.abc import Mapping
from dataclasses import replace

import numpy as np
from mpi4py import MPI

from benchmarks.graph_partition import graph_partition
from fenics_contact import (
    Body,
    ContactPair,
    Coulomb,
    RigidPlane,
    Scene,
    State,
    Support,
    Surface,
    Traction,
    solve_scene,
)
from fenics_contact.gallery import block, rectangle
from fenics_contact.materials import IsotropicElasticity, PlaneStress
from fenics_contact.mesh import quadratic

SOFT, STIFF = IsotropicElasticity(70.0, 0.3), IsotropicElasticity(2100.0, 0.2)


def patched() -> Scene:
    """A beam of which one end is thirty times stiffer: copies of a node feel different stiffnesses."""
    mesh = block((0.3, 0.1, 0.0), (3.4, 1.2, 0.7), (7, 3, 3))
    left = mesh.points[mesh.cells].mean(axis=1)[:, 0] < 1.7
    mesh = replace(mesh, regions={"left": np.flatnonzero(left), "right": np.flatnonzero(~left)})
    body = Body(mesh, {"left": STIFF, "right": SOFT})
    return Scene({"beam": body}, [Support("beam", "x0")], [Traction("beam", "z1", (0.3, 0.1, -1.0))])


def pressed() -> Scene:
    """A plate of quadratic cells, pressed and dragged over a rigid floor."""
    mesh = quadratic(rectangle((0.0, 0.0), (3.1, 1.3), (9, 5)))
    floor = RigidPlane((0.0, -0.001), (0.0, 1.0))
    return Scene(
        {"plate": Body(mesh, PlaneStress(100.0, 0.3))},
        [Support("plate", "y1", (0.02, -0.03))],
        contacts=[ContactPair(Surface("plate", "y0"), floor, Coulomb(0.3))],
    )


def cut(scene: Scene) -> Mapping[str, np.ndarray]:
    """Subdomains of which more than two meet in some nodes, each of one material."""
    found = {}
    for name, body in scene.bodies.items():
        found[name] = graph_partition(body.mesh, 5)
        if body.mesh.regions:
            upper = body.mesh.points[body.mesh.cells].mean(axis=1)[:, 1] > 0.6
            found[name] = 2 * body.material_of_cells + upper
    return found


def fields(state: State) -> dict[str, list[float]]:
    """Return the displacement and the stress of all bodies. Collective."""
    bodies = state.scene.bodies
    return {
        "displacement": np.concatenate([state.gather_displacement(name).ravel() for name in bodies]).tolist(),
        "von mises": np.concatenate([state.gather_von_mises(name) for name in bodies]).tolist(),
    }


SCENES = {"patched": patched, "pressed": pressed}


def main(comm: MPI.Comm) -> None:
    found = {name: fields(solve_scene(make(), comm, partitions=cut(make()))) for name, make in SCENES.items()}
    if comm.rank == 0:
        sys.stdout.write(json.dumps(found))


if __name__ == "__main__":
    main(MPI.COMM_WORLD)
