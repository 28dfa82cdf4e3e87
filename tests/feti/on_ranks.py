"""Operators of one scene with contact on any number of ranks; under mpirun, writes the numbers to a file."""

from __future__ import annotations

import sys

import numpy as np
import scipy.sparse as sp
from mpi4py import MPI

from fenics_contact.feti import DualSystem, build_torn_system, decompose
from fenics_contact.feti.decomposition import DualNumbering
from fenics_contact.feti.inverse import LocalKind
from tests.feti.scenes import touching_blocks


def collect(comm: MPI.Comm) -> dict[str, np.ndarray]:
    """Return numbers that must not depend on the ranks, and the errors of the exchange."""
    scene, partitions = touching_blocks()
    torn = build_torn_system(scene, decompose(scene, partitions, comm))
    system = DualSystem(torn)
    problem, numbering = system.problem, system.torn.numbering
    # Dense ones are in single precision, and which subdomain of a kind is rounded depends on the ranks.
    in_double = DualSystem(torn, kind=LocalKind.IMPLICIT)
    everything = np.arange(numbering.total)
    first, second = np.sin(1.0 + numbering.owned), np.cos(3.0 * numbering.owned)

    def gathered(owned: np.ndarray) -> np.ndarray:
        return numbering.gather(owned, everything)

    return {
        "dual operator": gathered(system.apply(first)),
        "preconditioner": gathered(in_double.preconditioner(first)),
        "right side": gathered(problem.rhs),
        "diagonal": gathered(problem.diagonal),
        "coarse load": problem.coarse.load,
        "resultant": problem.coarse.apply(first),
        "projection": gathered(problem.coarse.project(first)),
        "gap": system.torn.points.gap,
        "asymmetry of F": np.array(
            problem.dot(second, system.apply(first)) - problem.dot(first, system.apply(second))
        ),
        "energy of F": np.array(problem.dot(first, system.apply(first))),
        "exchange": exchange_error(numbering),
        "owned": np.array(comm.allgather(len(numbering.owned))),
        "ghosts": np.array(comm.allgather(len(numbering.ghosts))),
        "discs": np.array(comm.allgather(len(system.torn.owned_discs))),
    }


def exchange_error(numbering: DualNumbering) -> np.ndarray:
    """Return errors of the exchange: values that ghosts receive, shares that owners receive, rows, places."""
    comm, rows = numbering.comm, numbering.local_rows
    received = numbering.to_local(np.sqrt(1.0 + numbering.owned))
    forward = np.abs(received - np.sqrt(1.0 + rows)).max()
    touching = np.zeros(numbering.total)
    touching[rows] = 1.0
    sharers = comm.allreduce(touching)
    backward = np.abs(
        numbering.to_owned(np.cos(rows)) - (sharers * np.cos(np.arange(numbering.total)))[numbering.owned]
    )
    shares = sp.csr_matrix((np.cos(rows), (np.arange(len(rows)), rows % 5)), shape=(len(rows), 5))
    summed = numbering.sum_rows(shares).toarray()
    expected = np.zeros_like(summed)
    expected[np.arange(len(expected)), numbering.owned % 5] = (sharers * np.cos(np.arange(numbering.total)))[
        numbering.owned
    ]
    place = numbering.position(numbering.owned) - (numbering.offset + np.arange(len(numbering.owned)))
    mine = np.array([forward, backward.max(), np.abs(summed - expected).max(), np.abs(place).max()])
    return np.max(comm.allgather(mine), axis=0)


if __name__ == "__main__":
    numbers = collect(MPI.COMM_WORLD)
    if MPI.COMM_WORLD.rank == 0:
        np.savez(sys.argv[1], **numbers)
