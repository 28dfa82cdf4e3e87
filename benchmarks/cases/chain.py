"""The chain from gmsh to its equilibrium: seconds by phase, products, memory, forces."""

from __future__ import annotations

from dataclasses import replace
from time import perf_counter
from typing import Any

import numpy as np
from mpi4py import MPI

from benchmarks.cases.measuring import nodal_forces, state_record
from benchmarks.cases.scene_data import FRICTION_COEFFICIENT, PAPER_BOXES, PAPER_CELLS, Counts
from fenics_contact import BodyMesh, PhaseTimer, box_partition, solve_scene
from fenics_contact.errors import FenicsContactError
from fenics_contact.mesh import bisection_partition
from fenics_contact.qp import FaceNewton
from fenics_contact.results.deformed_state import AnyState
from fenics_contact.study.measuring import slowest
from fenics_contact.study.scenes.chain_links import GRADING, chain, graded_links


def cold_state(
    comm: MPI.Comm,
    cells: Counts = PAPER_CELLS,
    boxes: Counts = PAPER_BOXES,
    *,
    parts: int | None = None,
    default_partition: bool = False,
    friction_coefficient: float = FRICTION_COEFFICIENT,
    tolerance: float = 1e-6,
    cell: str = "hexahedron",
    grading: float = GRADING,
) -> tuple[AnyState, float]:
    """Mesh, decompose and solve the chain, with nothing prepared. Collective.

    Args:
        comm: Communicator.
        cells: Cells of a link around, through and across.
        boxes: Subdomains of a link in the same directions.
        parts: If given, subdomains of a link by bisection instead of boxes.
        default_partition: Whether the scene is cut as it is by default.
        friction_coefficient: Of the pair.
        tolerance: Of every residual.
        cell: Cell type.
        grading: As of `LinkShape`; 0 for cells of equal length along the links.

    Returns:
        The state and the wall seconds of the slowest rank.
    """
    comm.Barrier()
    start, meshing = perf_counter(), PhaseTimer()
    with meshing.phase("mesh"):
        scene = chain(graded_links(cells, cell, grading), friction_coefficient)

    def cut(mesh: BodyMesh) -> np.ndarray:
        return box_partition(mesh, boxes) if parts is None else bisection_partition(mesh, parts)

    partitions = None if default_partition else {name: cut(body.mesh) for name, body in scene.bodies.items()}
    state = solve_scene(scene, comm, partitions=partitions, solver=FaceNewton(tolerance=tolerance))
    state = replace(state, seconds={**meshing.seconds, **state.seconds})
    return state, comm.allreduce(perf_counter() - start, op=MPI.MAX)


def measure(comm: MPI.Comm, *, forces: bool = False, **setting: Any) -> dict[str, Any]:
    """Return the record of one cold state, or the name of the error that refuses it. Collective.

    Args:
        comm: Communicator.
        forces: Add the force on every contact node.
        **setting: As in `cold_state`.
    """
    try:
        state, seconds = cold_state(comm, **setting)
    except FenicsContactError as error:
        return {"refused": type(error).__name__, "message": str(error)}
    record = {
        **state_record(state),
        "seconds": seconds,
        "phases": slowest(comm, state.seconds),
    }
    return {**record, "forces": nodal_forces(state)} if forces else record
