"""A plastic bar between two load steps, on any number of ranks; writes what it finds as JSON."""

from __future__ import annotations

import json

import numpy as np
from mpi4py import MPI

from fenics_contact import Body, ContactProblem, DeformedState, Scene, Support, box_partition
from fenics_contact.gallery import block
from fenics_contact.materials import FinitePlasticity

COMM = MPI.COMM_WORLD
MESH = block((0, 0, 0), (4, 1, 1), (8, 2, 2))


def twisted(share: float) -> Scene:
    """The far end pulled and bent."""
    body = Body(MESH, FinitePlasticity(200.0, 0.3, 0.2, 2.0))
    return Scene({"bar": body}, [Support("bar", "x0"), Support("bar", "x1", (0.1 * share, 0.4 * share, 0.0))])


problem = ContactProblem(
    twisted(0.0), COMM, partitions={"bar": box_partition(MESH, (4, 1, 1))}, tolerance=1e-9
)
for part in (0.5, 1.0, 0.6):
    state = problem.solve(twisted(part), before=problem.state)
assert isinstance(state, DeformedState)
answer = {
    "displacement": state.gather_displacement("bar"),
    "stress": state.gather_stress("bar"),
    "von_mises": state.gather_von_mises("bar"),
    "nodal": np.nan_to_num(state.gather_nodal_stress("bar")),
    "history": state.history.values["bar"],
}
if COMM.rank == 0:
    print(json.dumps({name: np.asarray(values).tolist() for name, values in answer.items()}))
