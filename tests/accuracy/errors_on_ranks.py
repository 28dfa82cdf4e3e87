"""Errors of states on the ranks of a communicator; run by the tests."""

from __future__ import annotations

import json
import sys

from mpi4py import MPI

from fenics_contact import solve_scene
from tests.accuracy.algebraic import CASES, measured, solver_of

NAMES = ("a linear block", "a body that friction holds", "two dimensions")


def main(comm: MPI.Comm) -> None:
    found = {}
    for name in NAMES:
        scene = CASES[name].make()
        state = solve_scene(scene, comm, partitions=CASES[name].cut(scene), solver=solver_of(scene, 1e-3))
        real, errors = measured(state), state.estimate_errors()
        found[name] = {
            "bound": real.bound,
            "error": real.error,
            "algebraic": errors.algebraic,
            "friction": errors.friction,
            "discretisation": errors.discretisation,
            "products": solve_scene(scene, comm, partitions=CASES[name].cut(scene)).counts["f_products"],
        }
    if comm.rank == 0:
        sys.stdout.write(json.dumps(found))


if __name__ == "__main__":
    main(MPI.COMM_WORLD)
