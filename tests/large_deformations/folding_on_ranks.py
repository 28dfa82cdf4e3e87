"""A slot that closes on itself, on any number of ranks; stores displacement and forces."""

from __future__ import annotations

import sys

import numpy as np
from mpi4py import MPI

from tests.hard.deformed.slender import slot_closes

state = slot_closes("slot", "slot").solve(MPI.COMM_WORLD)[-1]
displacement = state.gather_displacement("block")
if MPI.COMM_WORLD.rank == 0:
    np.savez(sys.argv[1], displacement=displacement, force=state.contact.force)
