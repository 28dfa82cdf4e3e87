"""One more design of the chain (motion, matrices, factors, state, adjoint, gradient) against a cold one."""

from __future__ import annotations

from collections.abc import Iterator
from time import perf_counter
from typing import Any

import numpy as np
from mpi4py import MPI

from benchmarks.cases.chain import cold_state
from benchmarks.cases.chain_design import BOUND, chain_shape_problem
from fenics_contact import ShapeProblem
from fenics_contact.study.measuring import slowest

#: Largest change of a control point from one design to the next, [mm]: as in the middle of an optimisation.
STEP = 0.05


def walk(size: int, steps: int) -> Iterator[np.ndarray]:
    """Yield designs that wander within the bounds, the same at each run.

    The net is smooth by itself: any control values give a smooth surface.
    """
    generator = np.random.default_rng(0)
    alpha: np.ndarray = np.zeros(size)
    for _ in range(steps):
        alpha = np.clip(alpha + generator.uniform(-STEP, STEP, size), -BOUND, BOUND)
        yield alpha


def seconds_of(comm: MPI.Comm, problem: ShapeProblem, alpha: np.ndarray) -> float:
    """Return the wall seconds of the slowest rank for value and subgradient of a design. Collective."""
    comm.Barrier()
    start = perf_counter()
    problem.evaluate(alpha)
    return comm.allreduce(perf_counter() - start, op=MPI.MAX)


def measure(comm: MPI.Comm, steps: int = 8) -> dict[str, Any]:
    """Return the seconds of a cold state, of the first design and of each later one. Collective."""
    state, cold = cold_state(comm)
    torn_unknowns = state.counts["torn_unknowns"]
    del state
    problem = chain_shape_problem(comm)
    first = seconds_of(comm, problem, np.zeros(problem.size))
    before, products = dict(problem.seconds), problem.products
    later = [seconds_of(comm, problem, alpha) for alpha in walk(problem.size, steps)]
    phases = {name: (spent - before.get(name, 0.0)) / steps for name, spent in problem.seconds.items()}
    return {
        "counts": {
            "torn_unknowns": torn_unknowns,
            "design_variables": problem.size,
            "later_products": problem.products - products,
        },
        "cold_seconds": cold,
        "first_seconds": first,
        "seconds": float(np.median(later)),
        "ratio": float(np.median(later)) / cold,
        "phases": slowest(comm, phases),
    }
