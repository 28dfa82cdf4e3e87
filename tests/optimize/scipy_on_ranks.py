"""A block's face is optimised by SLSQP under mpirun: prints the value, the first one, and two verdicts."""

from __future__ import annotations

import numpy as np
import scipy.optimize
from mpi4py import MPI

from fenics_contact import Coulomb
from fenics_contact.design import ForScipy, LinearConstraints
from tests.design.blocks import block_on_block, problem
from tests.design.rank_cases import same_bits

comm = MPI.COMM_WORLD
moving = problem(block_on_block(Coulomb(0.38), load=(0.6, 0.12, -2.0)), comm)
start = np.zeros(moving.size)
_, by_volume = moving.volume(start)
keep = LinearConstraints(-by_volume[None, :], [0.0])
task = ForScipy(moving, start, bounds=(start - 0.02, start + 0.02), constraints=keep)
scipy.optimize.minimize(**task.arguments("SLSQP"), options={"maxiter": 4})
same = same_bits(comm, *(visit.x for visit in task.visits), *(visit.value for visit in task.visits))

# A design that inverts cells turns every rank back.
wide = ForScipy(moving, start, bounds=(start - 9.0, start + 9.0))
wide(wide.arguments("SLSQP")["x0"])
value, _ = wide(np.linspace(-0.5, 0.5, moving.size))
invalid = bool(wide.visits[-1].note) and np.isfinite(value) and same_bits(comm, value)
if comm.rank == 0:
    print(task.best.value, task.visits[0].value, same, invalid)
