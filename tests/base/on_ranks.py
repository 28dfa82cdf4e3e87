"""A coarse problem factored on every rank, on one of them and on several: run under mpirun."""

from __future__ import annotations

import json
import sys
from typing import Any

import numpy as np
import scipy.sparse as sp
from mpi4py import MPI

from fenics_contact import Coulomb, solve_scene
from fenics_contact._base import sparse as shared_factor
from fenics_contact._base.sparse import SharedFactor
from fenics_contact.qp import FaceNewton, coarse
from fenics_contact.qp.coarse import SparseGramInverse
from tests.scenes import partitions, two_blocks


def factor_errors(comm: MPI.Comm) -> dict[str, float]:
    """Solve with an unsymmetric matrix to which every rank adds a part. Collective."""
    size = 30
    shares = [sp.random(size, size, 0.2, random_state=rank) for rank in range(comm.size)]
    shares[0] = shares[0] + 5 * sp.eye(size)
    whole, right = sum(shares).toarray(), np.arange(1.0, size + 1)
    expected = np.linalg.solve(whole, right)
    errors = {}
    for holders in range(1, comm.size + 1):
        factor = SharedFactor(comm, shares[comm.rank].tocsr(), np.full(size, 0.4), holders=holders)
        assert factor.holders == holders
        errors[str(holders)] = max(comm.allgather(float(np.abs(factor.solve(right) - expected).max())))
    return errors


def rank_of_singular(comm: MPI.Comm) -> int:
    """Find the rank of a Gram matrix with three null vectors, shared by all ranks. Collective."""
    columns = np.random.default_rng(2).standard_normal((17, 40))
    columns = np.vstack([columns, columns[:3]])
    mine = sp.csr_matrix(columns[:, comm.rank :: comm.size])
    return SparseGramInverse(comm, (mine @ mine.T).tocsr()).rank


def potential(comm: MPI.Comm, limit: int, rows_per_rank: int) -> dict[str, Any]:
    """Solve two blocks in contact with the coarse problem kept as the limits say. Collective."""
    scene, usual = two_blocks(Coulomb(0.38)), (coarse.DENSE_LIMIT, shared_factor.ROWS_PER_RANK)
    coarse.DENSE_LIMIT, shared_factor.ROWS_PER_RANK = limit, rows_per_rank
    try:
        state = solve_scene(
            scene, comm, partitions=partitions(scene, (2, 1, 1)), solver=FaceNewton(tolerance=1e-9)
        )
    finally:  # these processes run other scripts, too
        coarse.DENSE_LIMIT, shared_factor.ROWS_PER_RANK = usual
    return {
        "kind": type(state.system.problem.coarse.gram).__name__,
        "potential": state.energies.total_potential,
        "forces": state.contact.normal_force.tolist(),
        "products": state.solution.products,
    }


if __name__ == "__main__":
    world = MPI.COMM_WORLD
    answer = {
        "errors": factor_errors(world),
        "rank": rank_of_singular(world),
        "dense": potential(world, 10_000, 20_000),
        "one rank": potential(world, 0, 20_000),
        "several ranks": potential(world, 0, 10),
    }
    if world.rank == 0:
        sys.stdout.write("\n" + json.dumps(answer))
