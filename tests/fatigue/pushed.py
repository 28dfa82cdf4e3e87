"""A crowned block on a floor, pushed to and fro and pulled at its sides; as a script, on several ranks."""

from __future__ import annotations

import numpy as np
from mpi4py import MPI

from fenics_contact import ContactProblem, Coulomb, LoadStep, Scene, ShapeProblem, Traction
from fenics_contact.design import FrictionWork, LoadPath
from fenics_contact.fatigue import (
    FatemiSocie,
    FatigueNorm,
    Findley,
    SmithWatsonTopper,
    assess_cycle,
    ruiz_parameters,
)
from fenics_contact.fatigue.criteria import Criterion
from tests.design.chains import SOLVER
from tests.design.load_paths import PathLine, line_of, moved
from tests.design.plane_blocks import on_obstacle
from tests.scenes import partitions

CRITERIA: dict[str, Criterion] = {
    "Findley": Findley(0.3),
    "Smith, Watson, Topper": SmithWatsonTopper(),
    "Fatemi, Socie": FatemiSocie(0.5, 5.0),
}
CYCLE = ("push", "pull", "push again")


def steps() -> list[LoadStep]:
    def step(name: str, push: float, bulk: float) -> LoadStep:
        ends = [Traction("block", side, (sign * bulk, 0.0)) for side, sign in (("x0", -1.0), ("x1", 1.0))]
        return LoadStep(name, loads=[Traction("block", "y1", (push, -2.0)), *ends])

    return [step("press", 0.0, 0.0), *(step(name, *at) for name, at in zip(CYCLE, WAYS, strict=True))]


#: Push and bulk stress of the cycle.
WAYS = ((0.3, 1.0), (-0.3, -0.5), (0.3, 1.0))


def path_of(criterion: Criterion, comm: MPI.Comm = MPI.COMM_SELF, **more: float) -> LoadPath:
    scene: Scene = on_obstacle(Coulomb(0.3), "quadrilateral")
    contact = ContactProblem(scene, comm, partitions=partitions(scene), solver=SOLVER)
    norm = FatigueNorm("block", "y0", criterion, CYCLE, opening=0.1, **more)  # type: ignore[arg-type]
    return LoadPath(ShapeProblem(contact, moved(scene), FrictionWork()), steps(), norm)


def line(criterion: Criterion) -> PathLine:
    return line_of(path_of(criterion))


if __name__ == "__main__":
    path = path_of(CRITERIA["Smith, Watson, Topper"], MPI.COMM_WORLD)
    alpha = np.zeros(path.size)
    numbers = [*path(alpha)[1], path(alpha)[0]]
    cycle = [path.states_of(alpha)[name] for name in CYCLE]
    for criterion in CRITERIA.values():
        numbers.append(assess_cycle(cycle, criterion, opening=0.1).largest)
    numbers.append(ruiz_parameters(cycle, opening=0.1).f2.max())
    for rank in range(MPI.COMM_WORLD.size):
        MPI.COMM_WORLD.barrier()
        if MPI.COMM_WORLD.rank == rank:
            print(*numbers, flush=True)
