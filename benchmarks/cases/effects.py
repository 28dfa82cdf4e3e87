"""One scene with more and more effects: what each of them adds."""

from __future__ import annotations

from dataclasses import replace
from time import perf_counter
from typing import Any

import numpy as np
from mpi4py import MPI

from benchmarks.cases.measuring import state_record
from fenics_contact import (
    Body,
    BodyForce,
    BodyMesh,
    ContactPair,
    ContactProblem,
    Coulomb,
    Scene,
    ShapeProblem,
    State,
    Support,
    Surface,
    SurfaceDesign,
    ThermalStrain,
    Tresca,
    box_partition,
    solve_scene,
)
from fenics_contact._scene.pairs import Friction
from fenics_contact.design import TotalPotential
from fenics_contact.gallery import DesignSurface, block
from fenics_contact.materials import IsotropicElasticity
from fenics_contact.study.measuring import slowest

CELLS, BOXES = 24, 4
PRESSED, SHEARED, HEAT, WEIGHT = -0.004, 0.006, 10.0, -50.0
LAWS: dict[str, Friction] = {"none": None, "contact": None, "Tresca": Tresca(60.0)}


def scene_of(level: str) -> Scene:
    """Return two cubes upon each other, the lower one held, the upper one pressed and sheared at its top.

    Both are held by their supports, so that the scene makes sense without contact, too; the upper one bulges.
    """
    lower = block((0, 0, 0), (1, 1, 1), (CELLS,) * 3)
    upper = block((0, 0, 1), (1, 1, 2), (CELLS,) * 3)
    points = upper.points.copy()
    points[:, 2] += 0.005 * (points[:, 0] - 0.5) ** 2 * (2.0 - points[:, 2])
    steel = IsotropicElasticity(2.1e5, 0.3, thermal_expansion=1.2e-5)
    bodies = {"lower": Body(lower, steel), "upper": Body(upper.moved(points), steel)}
    supports = [Support("lower", "z0"), Support("upper", "z1", (SHEARED, 0.0, PRESSED))]
    pair = ContactPair(Surface("upper", "z0"), Surface("lower", "z1"), LAWS.get(level, Coulomb(0.3)))
    weights = [BodyForce(name, (0.0, 0.0, WEIGHT)) for name in bodies]
    scene = Scene(bodies, supports, weights, [] if level == "none" else [pair])
    heated = level in ("thermal", "sensitivity")
    return replace(scene, loads=[*weights, ThermalStrain("upper", HEAT)]) if heated else scene


def partitions_of(scene: Scene) -> dict[str, np.ndarray]:
    """Cut every cube into boxes."""
    return {name: box_partition(body.mesh, (BOXES,) * 3) for name, body in scene.bodies.items()}


def upper_face(mesh: BodyMesh) -> DesignSurface:
    """Return the upper face of a cube as a surface that a design may move."""
    nodes = np.flatnonzero(mesh.points[:, 2] == 1.0)
    nodes = nodes[np.lexsort(mesh.points[nodes, 1::-1].T)]
    directions = np.tile([0.0, 0.0, 1.0], (len(nodes), 1))
    return DesignSurface(nodes, mesh.points[nodes, :2], directions, (CELLS + 1, CELLS + 1))


def with_gradient(scene: Scene, comm: MPI.Comm) -> State:
    """Return the state after value and subgradient of the total potential by the lower contact face."""
    design = SurfaceDesign("lower", upper_face(scene.bodies["lower"].mesh), net=(4, 4))
    problem = ShapeProblem(
        ContactProblem(scene, comm, partitions=partitions_of(scene)), design, TotalPotential()
    )
    point = problem.evaluate(np.zeros(problem.size))
    assert np.abs(point.gradient).max() > 0.0
    return point.state


def measure(comm: MPI.Comm, level: str) -> dict[str, Any]:
    """Return seconds, phases and counts of one level, cold. Collective."""
    scene = scene_of(level)
    comm.Barrier()
    start = perf_counter()
    if level == "sensitivity":
        state = with_gradient(scene, comm)
    else:
        tolerance = 1e-6 if scene.contacts else 1e-10
        state = solve_scene(scene, comm, partitions=partitions_of(scene), tolerance=tolerance)
    seconds = comm.allreduce(perf_counter() - start, op=MPI.MAX)
    plan = scene.plan(partitions_of(scene), sensitivity=level == "sensitivity")
    return {
        **state_record(state),
        "seconds": seconds,
        "phases": slowest(comm, state.seconds),
        "forms": len(state.torn.decomposition.forms.compiled),
        "expected_memory": plan.memory,
        "solver": plan.solver.value,
        "cone": plan.cone.value,
    }
