"""A plane block that nothing but friction holds on a rigid line, pressed and pushed."""

from __future__ import annotations

from typing import Any

import numpy as np
from mpi4py import MPI

from fenics_contact import Body, ContactPair, Coulomb, RigidPlane, Scene, SceneResponse, Surface, TotalForce
from fenics_contact.gallery import rectangle
from fenics_contact.materials import PlaneStrain

MESH = rectangle((0, 0), (2, 1), (8, 4))
FLOOR = RigidPlane((0.0, 0.0), (0.0, 1.0))
NOMINAL = {"friction": 0.3, "load": 1000.0, "modulus": 2e5}
PUSH = 200.0
QUANTITIES = {
    "force": lambda state: state.contact.normal_force.sum(),
    "largest pressure": lambda state: state.contact.pressure.max(),
    "friction force": lambda state: abs(state.contact.friction_force.sum()),
}


def scene(friction: float, load: float, modulus: float) -> Scene:
    """The block under a load and a push that does not change."""
    return Scene(
        {"block": Body(MESH, PlaneStrain(modulus, 0.3))},
        loads=[TotalForce("block", "y1", (PUSH, -load))],
        contacts=[ContactPair(Surface("block", "y0"), FLOOR, Coulomb(friction))],
    )


def partition(parts: int = 4) -> dict[str, np.ndarray]:
    """Columns of cells."""
    centre = MESH.points[MESH.cells].mean(axis=1)[:, 0]
    return {"block": np.minimum((centre * parts / 2.0).astype(int), parts - 1)}


def response(comm: MPI.Comm = MPI.COMM_SELF, **more: Any) -> SceneResponse:
    """Forces and pressure by friction, load and modulus."""
    more = {"partitions": partition(), **more}
    return SceneResponse(scene, NOMINAL, QUANTITIES, comm, **more)
