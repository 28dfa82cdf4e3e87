"""Scenes for the errors of solvers, and these errors against solutions that are accurate to many digits."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass, replace
from functools import lru_cache

import numpy as np
from mpi4py import MPI

from benchmarks.graph_partition import graph_partition
from fenics_contact import (
    Body,
    ContactPair,
    ContactProblem,
    Coulomb,
    RigidSphere,
    Scene,
    Support,
    Surface,
    TotalForce,
    Traction,
    Tresca,
    box_partition,
    solve_scene,
)
from fenics_contact._accuracy.certificate import Certificate, certify
from fenics_contact._accuracy.state_errors import friction_error
from fenics_contact.gallery import block, hemisphere, rectangle
from fenics_contact.materials import PlaneStress
from fenics_contact.mesh import bisection_partition, quadratic
from fenics_contact.qp import DualSolver, FaceNewton, ProjectedCG, solve
from fenics_contact.results.deformed_state import AnyState
from fenics_contact.results.dual_solve import solve_dual
from tests import scenes
from tests.equilibrium import effect_cases
from tests.scenes import FLOOR, SOFT

Cut = Callable[[Scene], Mapping[str, np.ndarray]]


def boxes(*counts: int) -> Cut:
    return lambda scene: {
        name: box_partition(body.mesh, counts[: scene.dim]) for name, body in scene.bodies.items()
    }


def bisected(count: int) -> Cut:
    return lambda scene: {name: bisection_partition(body.mesh, count) for name, body in scene.bodies.items()}


def graph(count: int) -> Cut:
    return lambda scene: {name: graph_partition(body.mesh, count) for name, body in scene.bodies.items()}


def clamped() -> Scene:
    mesh = block((0, 0, 0), (2, 1, 1), (8, 4, 4))
    load = Traction("block", "z1", (1.0, 0.3, -2.0))
    return Scene({"block": Body(mesh, SOFT)}, [Support("block", "x0")], [load])


def stretched() -> Scene:
    """A block whose ends have prescribed displacements, which become rows of B."""
    scene = clamped()
    moved = Support("block", "x1", (0.01, None, 0.02))
    return Scene(scene.bodies, [*scene.supports, moved], scene.loads)


def ball() -> Scene:
    """A quarter of a ball pressed on a plane."""
    supports = [Support("ball", "x0", (0.0, None, None)), Support("ball", "y0", (None, 0.0, None))]
    return Scene(
        {"ball": Body(hemisphere(1.0, 4, grading=2.0), SOFT)},
        supports,
        [TotalForce("ball", "top", (0.0, 0.0, -0.3))],
        [ContactPair(Surface("ball", "contact"), FLOOR)],
    )


def belt() -> Scene:
    """A thin belt that is drawn around a quarter of a drum: all of it slides, and hardly stretches."""
    mesh = rectangle((0.0, 0.0), (np.pi / 2, 0.02), (100, 1))
    angle, radius = mesh.points[:, 0], 1.0 + mesh.points[:, 1]
    mesh = mesh.moved(np.column_stack([radius * np.sin(angle), radius * np.cos(angle)]))
    return Scene(
        {"belt": Body(mesh, PlaneStress(1e6, 0.3))},
        [Support("belt", "x0", (lambda x: -0.03 * x[:, 1], None))],
        [Traction("belt", "x1", (0.0, -50.0))],
        [ContactPair(Surface("belt", "y0"), RigidSphere((0.0, 0.0), 1.0), Coulomb(0.3))],
    )


def curved() -> Scene:
    """The pressed plate of quadratic cells, whose corners and midpoints are contact points."""
    scene = effect_cases.plane()
    return replace(
        scene, bodies={name: replace(b, mesh=quadratic(b.mesh)) for name, b in scene.bodies.items()}
    )


@dataclass(frozen=True)
class Case:
    """A scene with its partition.

    Attributes:
        make: Builds the scene.
        cut: Cuts it.
        finest: The tolerance of the solution that counts as exact.
        factor: The bound is below so many times the error.
    """

    make: Callable[[], Scene]
    cut: Cut
    finest: float = 1e-11
    factor: float = 10.0


CASES = {
    "a linear block": Case(clamped, graph(5)),
    "prescribed displacements": Case(stretched, boxes(2, 2, 1)),
    "a ball on a plane": Case(ball, bisected(4)),
    "a frictionless pair": Case(lambda: scenes.guided(scenes.two_blocks(None), "upper"), boxes(2, 1, 2)),
    "Tresca's law": Case(lambda: scenes.two_blocks(Tresca(0.8)), boxes(2, 2, 1)),
    "Coulomb's law": Case(lambda: scenes.pressed_block(Coulomb(0.3)), boxes(3, 1, 1)),
    "a body that friction holds": Case(lambda: scenes.two_blocks(Coulomb(0.38)), boxes(2, 1, 1)),
    "bodies that float on each other": Case(lambda: scenes.stack(Coulomb(0.4), Coulomb(0.5)), boxes(2, 1, 1)),
    "nodes in two pairs": Case(lambda: scenes.cornered_block(Coulomb(0.3)), boxes(2, 1, 1)),
    "a mortar pair": Case(effect_cases.mortar, graph(4)),
    # What is left between parts of the stiff body the preconditioner closes at ten times the least energy.
    "a stiff body on a soft one": Case(effect_cases.stiff_on_soft, graph(4), factor=15.0),
    "a tie": Case(effect_cases.tied, graph(4)),
    "a thin belt": Case(belt, boxes(6, 1), 1e-9),
    "quadratic cells": Case(curved, graph(4)),
    "two dimensions": Case(effect_cases.plane, graph(4)),
}


def solver_of(scene: Scene, tolerance: float) -> DualSolver:
    return FaceNewton(tolerance=tolerance) if scene.contacts else ProjectedCG(tolerance=tolerance)


@lru_cache(maxsize=1)
def first_state(name: str) -> AnyState:
    """The state that the others of a case share their factors with."""
    case = CASES[name]
    scene = case.make()
    return solve_scene(scene, MPI.COMM_SELF, partitions=case.cut(scene), solver=solver_of(scene, 0.1))


def energy_norm(state: AnyState, displacement: np.ndarray) -> float:
    """Return √(vᵀK v) of a torn displacement. Collective."""
    total, start = 0.0, 0
    for subdomain in state.torn.subdomains:
        part = displacement[start : start + subdomain.mesh.size]
        total += max(0.0, float(part @ (subdomain.stiffness @ part)))
        start += subdomain.mesh.size
    return float(np.sqrt(state.torn.numbering.comm.allreduce(total)))


@dataclass(frozen=True)
class Measured:
    """Errors of a state as found and as they are, relative to its norm.

    Attributes:
        certificate: What `certify` found.
        bound: Its bound.
        friction: The estimate by Coulomb's law.
        error: The error to the solution with the state's slip bounds.
        law: Distance of that solution from the one of Coulomb's law.
        whole: The error to the solution of Coulomb's law.
        shown: The error of the displacement that fields show to the solution with the state's slip bounds.
        shown_whole: The same to the solution of Coulomb's law.
    """

    certificate: Certificate
    bound: float
    friction: float
    error: float
    law: float
    whole: float
    shown: float
    shown_whole: float


def measured(state: AnyState, finest: float = 1e-11) -> Measured:
    """Compare what is found for a state with solutions of many digits. Collective."""
    system, solution, scene = state.dual, state.dual_solution, state.scene
    certificate = certify(system, solution)
    friction = friction_error(system, solution, certificate)
    exact = solver_of(scene, finest)
    tresca = solve(system.problem, solution.slip_bound, exact, solution)
    at_bounds = system.displacement(tresca.multiplier, tresca.alpha)
    right = at_bounds
    if np.any(state.torn.groups.slips.coefficient > 0):
        coulomb = solve_dual(system, exact, solution)
        right = system.displacement(coulomb.multiplier, coulomb.alpha)
    norm = energy_norm(state, right)
    torn, shown = state.torn_displacement, state.conforming_displacement
    differences = (torn - at_bounds, at_bounds - right, torn - right, shown - at_bounds, shown - right)
    distances = (energy_norm(state, v) / norm for v in differences)
    return Measured(certificate, certificate.bound / norm, friction / norm, *distances)


def solved(name: str, tolerance: float | None) -> AnyState:
    """Return the state of a case to a tolerance, or to that which users get, from a cold start."""
    first = first_state(name)
    solver = None if tolerance is None else solver_of(first.scene, tolerance)
    return ContactProblem.following(first, solver=solver).solve(start=None)
