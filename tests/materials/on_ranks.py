"""A heated body of two materials beside a plain one, on any number of ranks; writes what it finds as JSON."""

from __future__ import annotations

import json
import sys

import numpy as np
from mpi4py import MPI

from fenics_contact import (
    Body,
    BodyForce,
    InitialStress,
    Pressure,
    Scene,
    Support,
    ThermalStrain,
    Ufl,
    box_partition,
    solve_scene,
)
from fenics_contact.errors import InvalidInputError
from fenics_contact.materials import IsotropicElasticity, PlaneStress, rigid_body_modes
from tests.materials.bodies import bent, box, in_halves, steel


def scene_of(cell: str) -> Scene:
    mesh = in_halves(bent(box(cell)), 0.7)
    kind = PlaneStress if mesh.dim == 2 else IsotropicElasticity
    materials = {"left": kind(100.0, 0.3, 1e-3), "right": steel(mesh.dim, 20.0, 3e-3)}
    return Scene(
        {"heated": Body(mesh, materials), "plain": Body(box(cell), steel(mesh.dim))},
        [Support(name, "x0", (0.0,) * mesh.dim) for name in ("heated", "plain")],
        [
            ThermalStrain("heated", lambda points: 10.0 * points[:, 1]),
            ThermalStrain("heated", Ufl(lambda x: x[0] ** 2)),
            Pressure("heated", "x1", lambda points: points[:, 1]),
            BodyForce("plain", Ufl(lambda x: x)),
            BodyForce("heated", (0.0, 2.0, 1.0)[: mesh.dim], "left"),
            InitialStress("plain", lambda points: np.outer(points[:, 0], (3.0, -2.0, 1.0, 0.0, 0.0, 2.0))),
            InitialStress("heated", (3.0, -2.0, 0.0, 0.0, 0.0, 2.0), "right"),
        ],
    )


class Wrong(IsotropicElasticity):
    """Its kernel lacks a rotation."""

    def kernel(self, points: np.ndarray) -> np.ndarray:
        return rigid_body_modes(points)[..., :5]


def refused(comm: MPI.Comm) -> list[str]:
    """What each rank says of a wrong material of a body that lives on the last rank alone."""
    mesh = box("hexahedron")
    scene = Scene({"good": Body(mesh, steel(3)), "bad": Body(mesh, Wrong(1.0, 0.3))})
    cut = {"good": box_partition(mesh, (4, 1, 1)), "bad": np.zeros(mesh.n_cells, dtype=int)}
    try:
        solve_scene(scene, comm, partitions=cut)
    except InvalidInputError as error:
        return comm.allgather(str(error))
    return comm.allgather("")


def main() -> None:
    comm = MPI.COMM_WORLD
    found = {}
    for cell in ("triangle", "hexahedron"):
        scene = scene_of(cell)
        boxes = {"heated": (2, 1, 1), "plain": (4, 1, 1)}
        cut = {n: box_partition(body.mesh, boxes[n][: scene.dim]) for n, body in scene.bodies.items()}
        state = solve_scene(scene, comm, partitions=cut, tolerance=1e-10)
        for name in scene.bodies:
            field = state.gather_displacement(name), state.gather_von_mises(name)
            found[f"{cell} {name}"] = [part.ravel().tolist() for part in field]
        held = comm.gather(
            state.von_mises["heated"].function_space.mesh.topology.index_map(scene.dim).size_local
        )
        found[f"{cell} cells"] = held
    found["refused"] = refused(comm)
    if comm.rank == 0:
        sys.stdout.write(json.dumps(found))


if __name__ == "__main__":
    main()
