"""A block in a corner of rigid planes: ``corner_cases.py`` prints products and forces on its ranks."""

from __future__ import annotations

import json
import sys

from mpi4py import MPI

from fenics_contact import (
    Body,
    ContactPair,
    ContactProblem,
    Coulomb,
    FixedPoint,
    RigidPlane,
    Scene,
    State,
    Support,
    Surface,
    box_partition,
)
from fenics_contact.gallery import block
from fenics_contact.materials import IsotropicElasticity
from fenics_contact.qp import FaceNewton, Smalse


def planes(*pairs: tuple[str, RigidPlane, float | None]) -> Scene:
    """A block pressed down on planes, each with its surface and friction coefficient."""
    mesh = block((0.0, 0.0, 0.0), (2.0, 1.0, 1.0), (5, 3, 3))
    contacts = [
        ContactPair(Surface("block", side), plane, mu if mu is None else Coulomb(mu), interference="measured")
        for side, plane, mu in pairs
    ]
    bodies = {"block": Body(mesh, IsotropicElasticity(1000.0, 0.3))}
    return Scene(bodies, [Support("block", "z1", (0.0, 0.0, -0.01))], contacts=contacts)


def corner(friction: float, push: float) -> Scene:
    """The block on a rough floor, pushed aside by a smooth wall."""
    floor = RigidPlane((0.0, 0.0, 0.0), (0.0, 0.0, 1.0))
    wall = RigidPlane((0.0, push, 0.0), (0.0, 1.0, 0.0))
    return planes(("z0", floor, friction), ("y0", wall, None))


def solved(scene: Scene, comm: MPI.Comm, solver: FaceNewton | FixedPoint | Smalse) -> State:
    cut = {"block": box_partition(scene.bodies["block"].mesh, (2, 1, 1))}
    return ContactProblem(scene, comm, partitions=cut, solver=solver).solve()


if __name__ == "__main__":
    state = solved(corner(1.0, 0.002), MPI.COMM_WORLD, FaceNewton(1e-9))
    if MPI.COMM_WORLD.rank == 0:
        sys.stdout.write(
            json.dumps([MPI.COMM_WORLD.size, state.solution.products, state.contact.force.tolist()])
        )
