"""One linear solve on the mesh of `sliding_block`, without contact, by PETSc alone."""

from __future__ import annotations

from functools import partial
from time import perf_counter
from typing import Any

from mpi4py import MPI

from benchmarks.cases.monolithic.elasticity import assemble_block, assemble_part
from benchmarks.cases.monolithic.linear import solve_linear
from benchmarks.cases.scene_data import Counts
from benchmarks.cases.scenes import drilled_block
from fenics_contact.study.measuring import slowest


def measure(
    comm: MPI.Comm, counts: Counts | None = None, solver: str = "gamg", size: float = 0.0
) -> dict[str, Any]:
    """Return the record of one solve from the mesh on. Collective.

    Args:
        comm: Communicator.
        counts: Cells along x, y and z; None: the drilled block of tetrahedra.
        solver: ``"gamg"`` or ``"cholesky"``, see `solve_linear`.
        size: Largest edge of a tetrahedron; gmsh's seconds do not count.
    """
    assemble = (
        partial(assemble_block, comm, counts) if counts else partial(assemble_part, comm, drilled_block(size))
    )
    comm.Barrier()
    start = perf_counter()
    block = assemble()
    assembled = perf_counter()
    solved = solve_linear(block, solver)
    end = perf_counter()
    return {
        "counts": {"unknowns": block.stiffness.size[0], "iterations": solved.iterations},
        "residual": solved.residual,
        "seconds": comm.allreduce(end - start, op=MPI.MAX),
        "phases": slowest(comm, {"assemble": assembled - start, "solve": end - assembled}),
    }
