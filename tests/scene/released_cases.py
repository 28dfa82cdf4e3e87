"""Bars whose ends are let go, held again and kept where they are: ``released_cases.py`` on any ranks."""

from __future__ import annotations

import json
import sys
from typing import Any

import numpy as np
from mpi4py import MPI

from fenics_contact import (
    Body,
    ContactProblem,
    HoldCurrent,
    LoadStep,
    Scene,
    Support,
    Traction,
    box_partition,
    solve_steps,
)
from fenics_contact.gallery import block
from fenics_contact.materials import IsotropicElasticity, J2Plasticity
from fenics_contact.results.deformed_state import AnyState

YOUNG, LENGTH, PULL, LOAD = 1000.0, 4.0, 0.1, 3.0
YIELD, HARDENING = 10.0, 500.0
HELD = Support("bar", "x0", (0.0, None, None))
SIDES = (Support("bar", "y0", (None, 0.0, None)), Support("bar", "z0", (None, None, 0.0)))


def bar(material: Any) -> Scene:
    mesh = block((0.0, 0.0, 0.0), (LENGTH, 1.0, 1.0), (8, 2, 2))
    return Scene({"bar": Body(mesh, material)}, [HELD, *SIDES])


def at_end(value: Any) -> tuple[Support, ...]:
    return HELD, *SIDES, Support("bar", "x1", (value, None, None))


#: Pulled by its end, let go under a load, held where it is, unloaded, let go, held at a value.
STEPS = (
    LoadStep("pull", supports=at_end(PULL)),
    LoadStep("let go", [Traction("bar", "x1", (LOAD, 0.0, 0.0))], [HELD, *SIDES]),
    LoadStep("keep", supports=at_end(HoldCurrent())),
    LoadStep("unload", []),
    LoadStep("let go again", supports=[HELD, *SIDES]),
    LoadStep("hold at a value", supports=at_end(PULL)),
)


def end_of(state: AnyState) -> float:
    """The displacement of the end, the same at all its nodes."""
    mesh = state.scene.bodies["bar"].mesh
    moved = state.gather_displacement("bar")[mesh.points[:, 0] == LENGTH, 0]
    assert np.ptp(moved) < 1e-8
    return float(moved.mean())


def history(material: Any, comm: MPI.Comm) -> dict[str, Any]:
    scene = bar(material)
    cut = {"bar": box_partition(scene.bodies["bar"].mesh, (4, 1, 1))}
    states = solve_steps(ContactProblem(scene, comm, partitions=cut, tolerance=1e-11), STEPS)
    return {
        "ranks": comm.size,
        "end": [end_of(state) for state in states],
        "reaction": [float(state.reactions()["bar x0"].force[0]) for state in states],
    }


def both(comm: MPI.Comm) -> dict[str, Any]:
    """The histories of an elastic bar and of a plastic one. Collective."""
    plastic = J2Plasticity(YOUNG, 0.0, YIELD, isotropic_hardening=HARDENING)
    return {"elastic": history(IsotropicElasticity(YOUNG, 0.0), comm), "plastic": history(plastic, comm)}


if __name__ == "__main__":
    answer = both(MPI.COMM_WORLD)
    if MPI.COMM_WORLD.rank == 0:
        sys.stdout.write(json.dumps(answer))
