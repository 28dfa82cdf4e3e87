"""Load cases of one design; as a script, value and subgradient on the ranks of this run."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
from mpi4py import MPI

from fenics_contact import ContactProblem, Coulomb, LoadStep, ShapeProblem, Traction
from fenics_contact.design import LoadCases, TotalPotential
from tests.design.blocks import block_on_block, designs_of
from tests.design.chains import SOLVER
from tests.scenes import partitions

WEIGHTS = {"pressed": 1.0, "dragged": 2.0, "rough": -0.5}


def cases_of(comm: MPI.Comm, weights: dict[str, float] | None) -> LoadCases:
    """Blocks pressed together, dragged, and rougher than usual."""
    scene = block_on_block(Coulomb(0.3), load=(0.0, 0.0, -3.0))
    contact = ContactProblem(scene, comm, partitions=partitions(scene), solver=SOLVER)
    first = ShapeProblem(contact, designs_of(scene), TotalPotential())
    drag = LoadStep("drag", loads=[Traction("upper", "z1", (0.3, 0.2, -2.0)), *scene.loads[1:]])
    rough = replace(scene, contacts=[replace(scene.contacts[0], friction=Coulomb(0.5))])
    return LoadCases(
        {"pressed": first, "dragged": first.case(drag.applied_to(scene)), "rough": first.case(rough)}, weights
    )


if __name__ == "__main__":
    both = cases_of(MPI.COMM_WORLD, None)
    value, gradient = both(0.002 * np.random.default_rng(0).standard_normal(both.size))
    if MPI.COMM_WORLD.rank == 0:
        print(value, *gradient)
