"""Rank 0 samples a scene that all ranks solve: run it under mpirun, prints answers and counts."""

from __future__ import annotations

import json

import numpy as np
from mpi4py import MPI

from fenics_contact import served
from tests.outer.pushed import response

comm = MPI.COMM_WORLD
block = response(comm, failures="nan")
rows = []
with served(block, comm) as call:
    if call is not None:
        for friction, load in ((0.3, 1000.0), (0.25, 900.0), (0.19, 1000.0), (0.5, 500.0)):
            rows.append(call(friction=friction, load=load).array.tolist())
evaluations = comm.allgather(block.evaluations)
if comm.rank == 0:
    print(json.dumps({"rows": np.nan_to_num(rows, nan=-1.0).tolist(), "evaluations": evaluations}))
