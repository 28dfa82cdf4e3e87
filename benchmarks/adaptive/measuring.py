"""Find the quantities of a case on meshes refined where it pays, and on meshes refined everywhere."""

from __future__ import annotations

import os
from time import perf_counter
from typing import Any

import numpy as np
from mpi4py import MPI

from benchmarks.adaptive.cases import CASES, Case
from fenics_contact import Scene, solve_scene
from fenics_contact._adaptive.equilibrium import solve_to
from fenics_contact._adaptive.levels import AccurateResult, Limits, unknowns_of
from fenics_contact._adaptive.refined_scene import refine_scene
from fenics_contact.design import Objective
from fenics_contact.design.forms import ShapeForms
from fenics_contact.results.state import State

#: Relative residual of all states.
TOLERANCE = 1e-6


def value_of(state: State, objective: Objective) -> float:
    """Return a quantity of a state; no node moves."""
    return float(objective.value(state, ShapeForms.at_rest(state.torn)))


def adaptive(scene: Scene, objective: Objective, accuracy: float, unknowns: int) -> AccurateResult:
    """Refine until an accuracy is reached, or the next mesh would have more unknowns."""
    return solve_to(
        scene, objective, accuracy, MPI.COMM_SELF, limits=Limits(unknowns=unknowns), tolerance=TOLERANCE
    )


def curve(found: AccurateResult) -> list[dict[str, Any]]:
    """Return unknowns, value and the seconds since the start of every mesh of a call."""
    seconds = np.cumsum([level.seconds for level in found.levels])
    return [
        {"unknowns": level.unknowns, "value": level.value, "seconds": float(spent)}
        for level, spent in zip(found.levels, seconds, strict=True)
    ]


def everywhere(scene: Scene, largest: int) -> list[Scene]:
    """Return the scene and those with all cells halved, again and again, up to a number of unknowns."""
    found = []
    while unknowns_of(scene) <= largest:
        found.append(scene)
        all_cells = {name: np.arange(body.mesh.n_cells) for name, body in scene.bodies.items()}
        scene = refine_scene(scene, all_cells).scene
    return found


def uniform(scene: Scene, case: Case) -> dict[str, Any]:
    """Return unknowns, values and seconds of one cold state: neither its mesh nor coarser ones count."""
    began = perf_counter()
    state = solve_scene(scene, MPI.COMM_SELF, tolerance=TOLERANCE)
    seconds = perf_counter() - began
    values = {name: value_of(state, each) for name, each in case.quantities.items()}
    return {"unknowns": unknowns_of(scene), "values": values, "seconds": seconds}


def study(
    comm: MPI.Comm, name: str, repeats: int = 3, share: float = 1.0, short: float = 20.0
) -> dict[str, Any]:
    """Measure a case; one process measures both ways in turn, so that both find the same load.

    Args:
        comm: Communicator of one rank.
        name: Name of the case.
        repeats: How often seconds are measured; medians are returned.
        share: Part of the largest numbers of unknowns that is used.
        short: Uniform meshes whose state takes longer are measured once, [s].
    """
    case, loads = CASES[name], []
    scene = case.scene()
    exact = dict(case.exact)
    for quantity in case.quantities.keys() - exact.keys():
        objective = case.quantities[quantity]
        exact[quantity] = adaptive(scene, objective, 1e-6, int(share * case.finest)).value
    meshes = everywhere(scene, int(share * case.largest))
    curves: list[dict[str, list[dict[str, Any]]]] = []
    states: list[list[dict[str, Any]]] = []
    for number in range(repeats):
        loads.append(os.getloadavg()[0])
        curves.append(
            {
                quantity: curve(adaptive(scene, each, case.accuracy, int(share * case.most)))
                for quantity, each in case.quantities.items()
            }
        )
        known: list[Any] = list(states[0]) if number else [None] * len(meshes)
        states.append(
            [
                before if before and before["seconds"] > short else uniform(mesh, case)
                for mesh, before in zip(meshes, known, strict=True)
            ]
        )
    coarse = _medians(states)
    return {
        "case": name,
        "exact": exact,
        "adaptive": {quantity: _medians([each[quantity] for each in curves]) for quantity in exact},
        "uniform": {
            quantity: [
                {"unknowns": run["unknowns"], "value": run["values"][quantity], "seconds": run["seconds"]}
                for run in coarse
            ]
            for quantity in exact
        },
        "loads": loads,
    }


def _medians(runs: list[list[dict[str, Any]]]) -> list[dict[str, Any]]:
    """Return the meshes, which are the same in all runs, with median seconds."""
    return [
        {**levels[0], "seconds": float(np.median([level["seconds"] for level in levels]))}
        for levels in zip(*runs, strict=True)
    ]
