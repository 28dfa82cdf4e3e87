"""The whole shape optimisation of the demo, from mesh to optimal design, without pictures and files."""

from __future__ import annotations

from time import perf_counter
from typing import Any

import numpy as np
from mpi4py import MPI

from benchmarks.cases.chain_design import BOUND, chain_shape_problem
from fenics_contact import minimize
from fenics_contact.design import BundleTrust, LinearConstraints
from fenics_contact.study.measuring import slowest


def measure(comm: MPI.Comm) -> dict[str, Any]:
    """Return the record of the optimisation. Collective."""
    comm.Barrier()
    start = perf_counter()
    problem = chain_shape_problem(comm)
    alpha = np.zeros(problem.size)
    _, volume_gradient = problem.volume(alpha)
    result = minimize(
        problem,
        alpha,
        BundleTrust(tolerance=1e-4),
        bounds=(np.full(problem.size, -BOUND), np.full(problem.size, BOUND)),
        constraints=LinearConstraints(-volume_gradient[None, :], [0.0]),
    )
    first, best = problem.first, problem.best
    assert first is not None
    assert best is not None
    seconds = comm.allreduce(perf_counter() - start, op=MPI.MAX)
    return {
        "counts": {
            "torn_unknowns": best.state.counts["torn_unknowns"],
            "design_variables": problem.size,
            "iterations": result.iterations,
            "evaluations": result.evaluations,
            "products": problem.products,
        },
        "objective_initial": first.value,
        "objective_final": best.value,
        "seconds": seconds,
        "phases": slowest(comm, problem.seconds),
    }
