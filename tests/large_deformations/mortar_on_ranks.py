"""A block drawn over another one by mortar, on any number of ranks; stores forces and displacements."""

from __future__ import annotations

import sys

import numpy as np
from mpi4py import MPI

from tests.large_deformations.mortar_scenes import followed, pressed_and_pushed

(state,) = followed(pressed_and_pushed(np.eye(3))[1:], MPI.COMM_WORLD)
answer = {name: state.gather_displacement(name) for name in ("low", "high")}
if MPI.COMM_WORLD.rank == 0:
    forces = {name: getattr(state.contact, name) for name in ("force", "pressure", "nominal_pressure")}
    np.savez(sys.argv[1], **forces, **answer)
