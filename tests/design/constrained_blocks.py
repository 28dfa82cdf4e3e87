"""A block whose volume is kept and whose largest contact force is limited; as a script, on ranks."""

from __future__ import annotations

from typing import Any

import numpy as np
from mpi4py import MPI

from fenics_contact import ContactProblem, Coulomb, ShapeProblem, minimize
from fenics_contact.design import (
    AdaptiveTolerance,
    BundleTrust,
    ContactForces,
    NonlinearConstraint,
    Result,
    TotalPotential,
)
from fenics_contact.design.base import DesignFunction
from fenics_contact.qp import FaceNewton
from fenics_contact.results import ContactResult
from tests.design.blocks import block_on_floor, designs_of
from tests.scenes import partitions

BOUND = 0.02
#: Largest normal force of a node relative to that of the reference shape, at most.
FORCE = 0.9


def largest_force(contact: ContactResult) -> tuple[float, np.ndarray, np.ndarray]:
    """The largest normal force of a node."""
    k = int(np.argmax(contact.normal_force))
    by_normal = np.eye(len(contact.normal_force))[k]
    return float(contact.normal_force[k]), by_normal, np.zeros((len(by_normal), 2))


def posed(tolerance: AdaptiveTolerance | None = None, comm: MPI.Comm = MPI.COMM_SELF) -> ShapeProblem:
    scene = block_on_floor(Coulomb(0.3), load=(0.35, 0.1, -2.0))
    cut = partitions(scene) if comm.size < 3 else scene.partition(4)
    contact = ContactProblem(scene, comm, partitions=cut, solver=FaceNewton(tolerance=1e-9))
    return ShapeProblem(contact, designs_of(scene), TotalPotential(), tolerance=tolerance)


def minimised(problem: ShapeProblem, share: float = FORCE, **more: Any) -> tuple[DesignFunction, Result]:
    """Minimise the energy; the volume is kept and the largest force limited below that of the start."""
    start = np.zeros(problem.size)
    volume = problem.volume(start)[0]
    force = problem.function(ContactForces(largest_force), "largest force")
    limit = share * force(start)[0]
    method = BundleTrust(**{"max_evaluations": 60, **more.pop("method", {})})
    constraints = [
        NonlinearConstraint(problem.volume, volume, volume, "volume"),
        NonlinearConstraint(force, limit, name="force"),
    ]
    box = (np.full(problem.size, -BOUND), np.full(problem.size, BOUND))
    return force, minimize(problem, start, method, bounds=box, constraints=constraints, restore=True, **more)


if __name__ == "__main__":
    _, found = minimised(posed(comm=MPI.COMM_WORLD))
    alike = len(set(MPI.COMM_WORLD.allgather(found.x.tobytes()))) == 1
    if MPI.COMM_WORLD.rank == 0:
        print(int(alike), found.evaluations, found.value, *found.x)
