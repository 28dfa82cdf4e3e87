"""The block pressed and dragged over a rigid plane with friction, solved by this package."""

from __future__ import annotations

from time import perf_counter
from typing import Any

from mpi4py import MPI

from benchmarks.cases.measuring import nodal_forces, state_record
from benchmarks.cases.scene_data import FRICTION_COEFFICIENT, Counts
from benchmarks.cases.scenes import block_mesh, block_on_plane, drilled_block
from fenics_contact import box_partition, solve_scene
from fenics_contact.qp import FaceNewton
from fenics_contact.study.measuring import slowest


def measure(
    comm: MPI.Comm,
    counts: Counts | None = None,
    boxes: Counts | None = None,
    friction_coefficient: float = FRICTION_COEFFICIENT,
    tolerance: float = 1e-6,
    size: float = 0.0,
) -> dict[str, Any]:
    """Return the record of the block's state. Collective.

    Args:
        comm: Communicator.
        counts: Cells along x, y and z; None: the drilled block of tetrahedra.
        boxes: Subdomains along x, y and z; by default the block is cut as any body.
        friction_coefficient: Between block and plane.
        tolerance: Of every residual.
        size: Largest edge of a tetrahedron; gmsh's seconds do not count.
    """
    mesh = None if counts else drilled_block(size)
    comm.Barrier()
    start = perf_counter()
    if counts:
        mesh = block_mesh(counts)
    assert mesh is not None
    scene = block_on_plane(mesh, friction_coefficient)
    solver = FaceNewton(tolerance=tolerance)
    partitions = {"block": box_partition(mesh, boxes)} if boxes else None
    state = solve_scene(scene, comm, partitions=partitions, solver=solver)
    seconds = comm.allreduce(perf_counter() - start, op=MPI.MAX)
    record = state_record(state)
    record["counts"]["unknowns"] = mesh.points.size
    return {
        **record,
        "seconds": seconds,
        "phases": slowest(comm, state.seconds),
        "forces": nodal_forces(state),
    }
