"""Small design problems that are interrupted: ``resumed_cases.py FOLDER`` goes on from what is there."""

from __future__ import annotations

import json
import shutil
import sys
from pathlib import Path
from tempfile import mkdtemp
from typing import Any

import numpy as np
from mpi4py import MPI

from fenics_contact import Checkpoint, ContactProblem, Coulomb, ShapeProblem, box_partition, minimize
from fenics_contact.design import (
    AdaptiveTolerance,
    BundleTrust,
    ContactForces,
    LinearConstraints,
    Result,
    TotalPotential,
)
from tests.design.blocks import block_on_floor, designs_of
from tests.design.chains import BOXES, chain, chain_designs
from tests.design.objectives import normal_forces
from tests.scenes import partitions

#: Loose, so that states depend on where they are started from; the block's follow the optimiser.
TOLERANCES: dict[str, float | AdaptiveTolerance] = {"block": AdaptiveTolerance(), "chain": 1e-5}
BOUND = {"block": 0.02, "chain": 0.2}


def posed(name: str, comm: MPI.Comm, tolerance: float | AdaptiveTolerance | None = None) -> ShapeProblem:
    tolerance = tolerance or TOLERANCES[name]
    if name == "block":
        scene = block_on_floor(Coulomb(0.3), load=(0.35, 0.1, -2.0))
        judge = ContactForces(normal_forces)
        return ShapeProblem(
            ContactProblem(scene, comm, partitions=partitions(scene)),
            designs_of(scene),
            judge,
            tolerance=tolerance,
        )
    scene = chain(Coulomb(0.3), pull=80e3)
    cut = {body: box_partition(scene.bodies[body].mesh, BOXES) for body in scene.bodies}
    return ShapeProblem(
        ContactProblem(scene, comm, partitions=cut), chain_designs(), TotalPotential(), tolerance=tolerance
    )


def minimised(
    name: str,
    problem: ShapeProblem,
    checkpoint: Checkpoint | None,
    callback: Any = None,
    **limits: Any,
) -> Result:
    """Minimise within a box, with the volume kept to first order."""
    size, bound = problem.size, BOUND[name]
    _, by_volume = problem.volume(np.zeros(size))
    return minimize(
        problem,
        np.zeros(size),
        BundleTrust(**{"max_evaluations": 15, **limits}),
        bounds=(np.full(size, -bound), np.full(size, bound)),
        constraints=LinearConstraints(np.zeros((0, size)), np.zeros(0), by_volume[None], np.zeros(1)),
        callback=callback,
        checkpoint=checkpoint,
    )


def gone_on(name: str, path: Path, comm: MPI.Comm) -> dict[str, Any]:
    """Finish a minimisation that another run has begun. Collective."""
    problem = posed(name, comm)
    result = minimised(name, problem, Checkpoint(path, resume=True))
    first, best = problem.first, problem.best
    assert first is not None
    assert best is not None
    return {
        "ranks": comm.size,
        "evaluated here": problem.seconds["adjoint"] > 0.0,
        "evaluations": problem.evaluations,
        "x": result.x.tolist(),
        "values": [record.value for record in result.history],
        "kinds": [record.kind.name for record in result.history],
        "first force": first.state.contact.force.tolist(),
        "best alpha": best.alpha.tolist(),
        "same": len(set(comm.allgather(result.x.tobytes()))) == 1,
    }


if __name__ == "__main__":
    # In a copy of its own: going on finishes what a file holds, and a launch may be repeated.
    folder = MPI.COMM_WORLD.bcast(Path(mkdtemp()) if MPI.COMM_WORLD.rank == 0 else None)
    if MPI.COMM_WORLD.rank == 0:
        shutil.copytree(sys.argv[1], folder, dirs_exist_ok=True)
    MPI.COMM_WORLD.barrier()
    found = {name: gone_on(name, folder / f"{name}.npz", MPI.COMM_WORLD) for name in BOUND}
    if MPI.COMM_WORLD.rank == 0:
        shutil.rmtree(folder)
        sys.stdout.write(json.dumps(found))
