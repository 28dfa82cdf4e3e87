"""Work that tells how far it is, on every rank, for tests that look at what is shown of it."""

from __future__ import annotations

import logging
import sys
import time

from mpi4py import MPI

from fenics_contact import show_progress
from fenics_contact._base.progress import Task

comm = MPI.COMM_WORLD
logging.basicConfig(level=logging.WARNING, format="%(message)s")
with show_progress(comm), Task(f"work of rank {comm.rank}", total=2) as work:
    for number in (1, 2):
        with Task("solve", unit="products", target=1e-6) as solve:
            for product in range(1, 4):
                solve.step(product, measure=10.0 ** (-3 * product))
                time.sleep(0.2)
        work.step(number)
        if comm.rank == 0:
            sys.stdout.write(f"printed after {number}\n")
            logging.getLogger("own").warning("logged after %d", number)
    comm.Barrier()
