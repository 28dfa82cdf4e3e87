"""A state printed by one rank alone; for the tests."""

from __future__ import annotations

import sys

from mpi4py import MPI

from fenics_contact import ContactProblem, Coulomb
from tests.scenes import partitions, two_blocks


def main(comm: MPI.Comm) -> None:
    scene = two_blocks(Coulomb(0.4))
    problem = ContactProblem(scene, comm, partitions=partitions(scene), tolerance=1e-8)
    state = problem.solve()
    if comm.rank == comm.size - 1:
        texts = [str(state), repr(state), repr(problem), repr(state.contact), repr(state.scene)]
        sys.stdout.write("\n".join(texts))
    comm.barrier()


if __name__ == "__main__":
    main(MPI.COMM_WORLD)
