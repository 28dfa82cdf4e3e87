"""A block on a plane in many boxes, with coarse matrices of any kind."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
from mpi4py import MPI

from fenics_contact import LinearState, Traction, box_partition, solve_scene
from fenics_contact.qp import FaceNewton
from fenics_contact.qp import coarse as coarse_module
from tests.ranks.counted import pressed_block


def resting(comm: MPI.Comm, boxes: tuple[int, int, int], limit: int, held: bool = True) -> LinearState:
    """Solve a block on a plane, some nodes sticking, supported or not, coarse matrices dense to a limit."""
    scene = pressed_block((9, 8, 7))
    if not held:
        scene = replace(scene, supports=[], loads=[Traction("block", "z1", (0.0005, 0.0003, -0.005))])
    parts = {"block": box_partition(scene.bodies["block"].mesh, boxes)}
    usual, coarse_module.DENSE_LIMIT = coarse_module.DENSE_LIMIT, limit
    try:
        state = solve_scene(scene, comm, partitions=parts, solver=FaceNewton(tolerance=1e-10))
    finally:  # ranks that wait run other scripts, too
        coarse_module.DENSE_LIMIT = usual
    assert isinstance(state, LinearState)
    return state


def forces(state: LinearState) -> np.ndarray:
    return np.asarray(state.contact.force[np.argsort(state.contact.points.slave)])
