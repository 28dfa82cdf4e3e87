"""Press fits and clearances on several ranks; run under mpirun, writes what they give as JSON."""

from __future__ import annotations

import json
import sys
from dataclasses import replace
from typing import Any

import numpy as np
from mpi4py import MPI

from fenics_contact import ContactProblem, Coulomb, Scene, solve_scene
from fenics_contact.errors import FenicsContactError
from tests.equilibrium.press_fits import press_fit
from tests.scenes import pressed_block, two_blocks


def varying(points: np.ndarray) -> np.ndarray:
    return np.asarray(0.002 * (1.0 + points[:, 0] ** 2))


def with_pair(scene: Scene, **given: Any) -> Scene:
    (pair,) = scene.contacts
    return replace(scene, contacts=[replace(pair, **given)])


def scenes() -> dict[str, Scene]:
    mortar: Any = {"discretisation": "mortar"}
    return {
        "press fit": press_fit(24, 4, outside=30, interference=0.05, **mortar),
        "field": with_pair(two_blocks(Coulomb(0.4)), gap=varying),
        "adjusted": with_pair(two_blocks(Coulomb(0.4)), adjust=0.01, interference=0.002),
        "obstacle": with_pair(pressed_block(None), gap=varying),
    }


def collect(comm: MPI.Comm) -> dict[str, Any]:
    """Solve all of them; one moved a little after its gap was given."""
    found: dict[str, Any] = {}
    for name, scene in scenes().items():
        contact = solve_scene(scene, comm, tolerance=1e-9).contact
        found[name] = [contact.points.gap.tolist(), contact.normal_force.tolist()]
    scene = scenes()["field"]
    mesh = scene.bodies["upper"].mesh
    moved = scene.reshaped({"upper": mesh.points + 1e-3 * np.sin(3.0 * mesh.points[:, :1])})
    points = ContactProblem(moved, comm, tolerance=1e-9).solve().contact.points
    found["moved"] = [points.gap.tolist(), points.distance.tolist()]
    return found


def messages(comm: MPI.Comm) -> list[str]:
    """What every rank is told where they have different functions, and where one rank's fails."""
    told = []
    for worse in (0.001, -0.001):
        slope = worse if comm.rank == 1 else 0.0
        try:
            solve_scene(with_pair(two_blocks(Coulomb(0.4)), gap=lambda x, s=slope: s * x[:, 0]), comm)
        except FenicsContactError as error:
            told.append(str(error))
    return told


if __name__ == "__main__":
    world = MPI.COMM_WORLD
    answer = {"found": world.gather(collect(world)), "messages": world.gather(messages(world))}
    if world.rank == 0:
        sys.stdout.write("\n" + json.dumps(answer))
