"""Scenes with the effects that a scene can call for, solved on the ranks of a communicator; see `collect`."""

from __future__ import annotations

import json
import sys
from collections.abc import Callable
from dataclasses import replace
from typing import Any

import numpy as np
from mpi4py import MPI

from benchmarks.graph_partition import graph_partition
from fenics_contact import (
    Body,
    ContactPair,
    ContactProblem,
    Coulomb,
    LoadStep,
    RigidSphere,
    Scene,
    State,
    Support,
    Surface,
    ThermalStrain,
    Tie,
    Traction,
    Tresca,
    Ufl,
    solve_steps,
)
from fenics_contact.gallery import block, rectangle
from fenics_contact.materials import IsotropicElasticity, PlaneStrain
from fenics_contact.mesh import quadratic
from fenics_contact.qp import DualSolver, FaceNewton, ProjectedCG
from tests.scenes import two_blocks

TOLERANCE = 1e-10
STEEL = IsotropicElasticity(1000.0, 0.3, thermal_expansion=1e-3)


def mortar() -> Scene:
    """The crowned block of 100 on the block of 300, by mortar; both are cut by the contact."""
    scene = two_blocks(Coulomb(0.38))
    return replace(scene, contacts=[replace(scene.contacts[0], discretisation="mortar")])


def stiff_on_soft() -> Scene:
    """The upper block a thousand times stiffer than the lower one."""
    scene = two_blocks(Tresca(0.8))
    bodies = {**scene.bodies, "upper": replace(scene.bodies["upper"], material=IsotropicElasticity(3e5, 0.3))}
    return replace(scene, bodies=bodies)


def quadratic_on_linear() -> Scene:
    """The lower block of quadratic cells, the crowned upper one of linear ones."""
    scene = two_blocks(Coulomb(0.38))
    lower = replace(scene.bodies["lower"], mesh=quadratic(scene.bodies["lower"].mesh))
    return replace(scene, bodies={**scene.bodies, "lower": lower})


def tied() -> Scene:
    """A tetrahedral block of two regions, one soft, tied upon another block that is clamped; heat in one."""
    lower, upper = (
        block((0, 0, 0), (2, 1, 1), (4, 3, 2)),
        block((0, 0, 1), (2, 1, 2), (5, 4, 2), "tetrahedron"),
    )
    left = upper.points[upper.cells].mean(axis=1)[:, 0] < 1.0
    upper = replace(upper, regions={"left": np.flatnonzero(left), "right": np.flatnonzero(~left)})
    parts = {
        "lower": Body(lower, STEEL),
        "upper": Body(upper, {"left": STEEL, "right": IsotropicElasticity(10.0, 0.3)}),
    }
    return Scene(
        parts,
        [Support("lower", "z0")],
        [Traction("upper", "z1", Ufl(_tilting)), ThermalStrain("lower", lambda points: points[:, 2])],
        ties=[Tie(Surface("upper", "z0"), Surface("lower", "z1"))],
    )


def _tilting(x: Any) -> Any:
    import ufl

    return ufl.as_vector([0.1, 0.0, -0.5 * x[0]])


def plane() -> Scene:
    """A plate pressed on a rigid disc and dragged along."""
    mesh = rectangle((-1, 0), (1, 1), (16, 8), "triangle")
    pair = ContactPair(Surface("plate", "y0"), RigidSphere((0.0, -3.0), 3.0), Coulomb(0.4))
    return Scene(
        {"plate": Body(mesh, PlaneStrain(100.0, 0.3))},
        [Support("plate", "y1", (0.02, -0.05))],
        contacts=[pair],
    )


def there_and_back() -> list[LoadStep]:
    return [LoadStep(f"{s}", supports=[Support("plate", "y1", (s, -0.05))]) for s in (0.02, 0.0, -0.02)]


AS_IT_IS = [LoadStep("all at once")]
CASES: dict[str, tuple[Callable[[], Scene], list[LoadStep]]] = {
    "mortar": (mortar, AS_IT_IS),
    "stiff on soft": (stiff_on_soft, AS_IT_IS),
    "quadratic": (quadratic_on_linear, AS_IT_IS),
    "tied": (tied, AS_IT_IS),
    "load steps in the plane": (plane, there_and_back()),
}


def solved(comm: MPI.Comm, name: str, parts: int) -> State:
    """Return the state of a case at the end of its steps, its bodies cut by METIS."""
    make, steps = CASES[name]
    scene = make()
    cut = {name: graph_partition(body.mesh, parts) for name, body in scene.bodies.items()}
    linear = ProjectedCG(tolerance=TOLERANCE)
    solver: DualSolver = FaceNewton(tolerance=TOLERANCE) if scene.contacts else linear
    return solve_steps(ContactProblem(scene, comm, partitions=cut, solver=solver), steps)[-1]


def figures(state: State) -> dict[str, Any]:
    """Return what must not depend on ranks or partition."""
    displacement = np.concatenate([state.gather_displacement(name).ravel() for name in state.scene.bodies])
    stress = np.concatenate([state.gather_von_mises(name) for name in state.scene.bodies])
    return {
        "energy": state.energies.total_potential,
        "friction": state.energies.friction,
        "force": state.contact.force.ravel().tolist(),
        "displacement": displacement.tolist(),
        "stress": stress.tolist(),
    }


def collect(comm: MPI.Comm) -> dict[str, Any]:
    """Run all cases. Collective."""
    return {name: figures(solved(comm, name, parts=4)) for name in CASES}


if __name__ == "__main__":
    answer = collect(MPI.COMM_WORLD)
    if MPI.COMM_WORLD.rank == 0:
        sys.stdout.write(json.dumps(answer))
