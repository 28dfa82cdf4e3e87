"""Solve the brick scenes on the ranks of the world and write the multipliers in global order."""

from __future__ import annotations

import sys
from pathlib import Path

import numpy as np
from mpi4py import MPI

sys.path.insert(0, str(Path(__file__).resolve().parents[2]))

from fenics_contact.errors import FenicsContactError
from fenics_contact.qp import FaceNewton, ProjectedCG, Smalse, solve
from tests.qp.torn_bricks import Bricks, row_owners, torn_problem


def solved(bricks: Bricks, solver, comm: MPI.Comm, slip_bound=None, friction_coefficient=None):
    dual, torn = torn_problem(bricks, comm)
    shape = dual.layout.n_friction
    bound = None if slip_bound is None else np.full(shape, slip_bound)
    mu_f = None if friction_coefficient is None else np.full(shape, friction_coefficient)
    found = solve(dual, bound, solver, friction_coefficient=mu_f)
    counts = comm.allgather((found.products, found.iterations, found.residuals, found.alpha.tobytes()))
    assert all(count == counts[0] for count in counts), "ranks disagree"
    owner = row_owners(torn, comm.size)
    order = np.concatenate([np.flatnonzero(owner == rank) for rank in range(comm.size)])
    full = np.empty(len(owner))
    full[order] = np.concatenate(comm.allgather(found.multiplier))
    return full, found.products


def main(folder: str) -> None:
    comm = MPI.COMM_WORLD
    scene = Bricks(cubes=(2, 2), crown=0.2, tilt=0.5)
    answers = {
        "linear": solved(Bricks(cubes=(2, 2), contact=False), ProjectedCG(1e-10), comm),
        "tresca": solved(scene, FaceNewton(tolerance=1e-10), comm, slip_bound=2.5e-4),
        "smalse": solved(scene, Smalse(tolerance=1e-10), comm, slip_bound=2.5e-4),
        "coulomb": solved(scene, FaceNewton(tolerance=1e-10), comm, friction_coefficient=0.3),
        "rescued": solved(
            scene,
            FaceNewton(tolerance=1e-10, patience=1, forcing=0.9, loosest=0.5),
            comm,
            friction_coefficient=0.3,
        ),
        "frictionless": solved(
            Bricks(friction=False, shear=0.0, crown=0.3), FaceNewton(tolerance=1e-10), comm
        ),
    }
    if comm.rank == 0:
        np.savez(
            Path(folder) / f"ranks{comm.size}.npz", **{name: answer[0] for name, answer in answers.items()}
        )
        print({name: answer[1] for name, answer in answers.items()})
    try:
        bad = np.full(torn_problem(scene, comm)[0].layout.n_friction, -1.0 if comm.rank == 0 else 1.0)
        solve(torn_problem(scene, comm)[0], bad, FaceNewton())
    except FenicsContactError as error:
        refused = comm.gather(str(error))
        if refused is not None:
            print(f"{len(refused)} ranks refused: {refused[-1]}")


if __name__ == "__main__":
    main(sys.argv[1])
