"""The block of `sliding_block`, the same discrete problem, by monolithic Newton with PETSc and MUMPS."""

from __future__ import annotations

from time import perf_counter
from typing import Any

import numpy as np
from mpi4py import MPI

from benchmarks.cases.monolithic.elasticity import assemble_block
from benchmarks.cases.monolithic.newton import solve_newton
from benchmarks.cases.scene_data import FRICTION_COEFFICIENT, Counts


def measure(
    comm: MPI.Comm,
    counts: Counts,
    friction_coefficient: float = FRICTION_COEFFICIENT,
    tolerance: float = 1e-6,
) -> dict[str, Any]:
    """Return the record of the block's state. Collective.

    Args:
        comm: Communicator.
        counts: Cells along x, y and z.
        friction_coefficient: Between block and plane.
        tolerance: Of both residuals.
    """
    comm.Barrier()
    start = perf_counter()
    block = assemble_block(comm, counts)
    assembled = perf_counter()
    solved = solve_newton(block, friction_coefficient, tolerance)
    seconds = comm.allreduce(perf_counter() - start, op=MPI.MAX)
    product = block.stiffness.createVecLeft()
    block.stiffness.mult(solved.displacement, product)
    potential = 0.5 * solved.displacement.dot(product) - solved.displacement.dot(block.load)
    points, forces, closed, stick = (
        np.concatenate(comm.allgather(x))
        for x in (block.points, solved.force, solved.contact.closed, solved.contact.stick)
    )
    # The order of the nodes of `block_mesh`: x slowest; all lie in the plane z = 0.
    order = np.lexsort(points.round(9).T[::-1])
    return {
        "counts": {
            "unknowns": block.stiffness.size[0],
            "newton_steps": solved.steps,
            "open": int(np.count_nonzero(~closed)),
            "stick": int(np.count_nonzero(stick)),
            "slip": int(np.count_nonzero(closed & ~stick)),
        },
        "total_potential": potential,
        "residual": solved.residual,
        "seconds": seconds,
        "phases": {"assemble": assembled - start, "solve": seconds - (assembled - start)},
        "forces": forces[order],
    }
