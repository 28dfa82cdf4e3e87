"""A block pressed on a plane without friction, a published solver's test case, with a known answer."""

from __future__ import annotations

from time import perf_counter
from typing import Any

from mpi4py import MPI

from benchmarks.cases.measuring import state_record
from benchmarks.cases.scenes import block_mesh, block_on_plane
from fenics_contact import box_partition, solve_scene
from fenics_contact.study.measuring import slowest

#: Total potential and closed nodes by an independent active-set solver.
TOTAL_POTENTIAL, CLOSED = -6.69653417522873e-3, 401


def measure(comm: MPI.Comm) -> dict[str, Any]:
    """Return the record of the block's state. Collective."""
    comm.Barrier()
    start = perf_counter()
    mesh = block_mesh((32, 16, 16))
    state = solve_scene(
        block_on_plane(mesh), comm, partitions={"block": box_partition(mesh, (4, 2, 2))}, tolerance=1e-6
    )
    seconds = comm.allreduce(perf_counter() - start, op=MPI.MAX)
    record = {**state_record(state), "seconds": seconds, "phases": slowest(comm, state.seconds)}
    record["counts"]["closed"] = int((state.contact.normal_force > 0).sum())
    error = abs(record["total_potential"] / TOTAL_POTENTIAL - 1.0)
    if record["counts"]["closed"] != CLOSED or error > 1e-7:
        raise RuntimeError(
            f"the block must close {CLOSED} nodes with potential {TOTAL_POTENTIAL}, got "
            f"{record['counts']['closed']} and {record['total_potential']}: the solver is wrong"
        )
    return {**record, "potential_error": error}
