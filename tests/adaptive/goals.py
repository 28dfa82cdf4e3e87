"""Scenes whose quantities are known on finer meshes, for estimates of their errors."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace

import numpy as np
from mpi4py import MPI

from fenics_contact import (
    Body,
    BodyForce,
    BodyMesh,
    ContactPair,
    ContactProblem,
    Coulomb,
    DistanceObstacle,
    LinearState,
    RigidPlane,
    RigidSphere,
    Scene,
    Support,
    Surface,
    Traction,
    goal_error,
    solve_scene,
)
from fenics_contact.design import ContactForces, LargestPressure, StrainEnergy
from fenics_contact.gallery import block, box_lattice, half_disc, rectangle, rectangle_lattice
from fenics_contact.materials import IsotropicElasticity, PlaneStrain
from fenics_contact.mesh import bisection_partition
from fenics_contact.results import ContactResult
from tests.scenes import Load

RUBBER = PlaneStrain(1000.0, 0.3)
FLOOR = RigidPlane((0.0, 0.0), (0.0, 1.0))
#: Height of the waves of a floor.
WAVE = 0.004


def solved(scene: Scene, parts: int = 2, tolerance: float = 1e-9) -> LinearState:
    cuts = {name: bisection_partition(body.mesh, parts) for name, body in scene.bodies.items()}
    state = solve_scene(scene, MPI.COMM_SELF, partitions=cuts, tolerance=tolerance)
    assert isinstance(state, LinearState)
    return state


def resultant(*direction: float) -> ContactForces:
    """The force on the slave of the first pair along a direction."""
    d = np.array(direction)

    def function(contact: ContactResult) -> tuple[float, np.ndarray, np.ndarray]:
        points = contact.points
        along = -np.einsum("nad,d->na", points.tangents, d)
        return float((contact.force @ d).sum()), points.normal @ d, along

    return ContactForces(function)


def on_waves(cells: int) -> Scene:
    """Half a period of a block that is pressed on a wavy floor until all of it touches: all is smooth."""

    def distance(x: np.ndarray) -> np.ndarray:
        return np.asarray(x[:, 1] + WAVE * (1.0 + np.cos(np.pi * x[:, 0])))

    def gradient(x: np.ndarray) -> np.ndarray:
        slope = np.column_stack([-WAVE * np.pi * np.sin(np.pi * x[:, 0]), np.ones(len(x))])
        return np.asarray(slope / np.linalg.norm(slope, axis=1)[:, None])

    mesh = rectangle((0.0, 0.0), (1.0, 1.0), (cells, cells))
    sides = [Support("block", side, (0.0, None)) for side in ("x0", "x1")]
    pair = ContactPair(Surface("block", "y0"), DistanceObstacle(distance, gradient))
    top = Support("block", "y1", (0.0, -0.05))
    return Scene({"block": Body(mesh, RUBBER)}, [*sides, top], contacts=[pair])


def wavy(cells: int) -> Scene:
    """The same with the wave on the block instead of the floor."""
    scene = on_waves(cells)
    mesh = scene.bodies["block"].mesh
    x, y = mesh.points.T
    moved = mesh.moved(np.column_stack([x, y + WAVE * (1.0 + np.cos(np.pi * x)) * (1.0 - y)]))
    pair = ContactPair(Surface("block", "y0"), FLOOR)
    return replace(scene, bodies={"block": Body(moved, RUBBER)}, contacts=[pair])


def on_floor(cells: int) -> Scene:
    """A block on a rough floor, pressed and dragged at its top: some nodes stick, others slip."""
    mesh = rectangle_lattice([np.linspace(0.0, 2.0, 2 * cells + 1), np.linspace(0.0, 1.0, cells + 1)])
    load = Traction("block", "y1", lambda x: np.column_stack([0.0 * x[:, 0] + 8.0, -20.0 - 10.0 * x[:, 0]]))
    pair = ContactPair(Surface("block", "y0"), FLOOR, Coulomb(0.3))
    side = Support("block", "x0", (0.0, None))
    return Scene({"block": Body(mesh, RUBBER)}, [side], [load], contacts=[pair])


def punched(cells: int) -> Scene:
    """A narrow block pressed on a wide one, meshes that do not match."""
    upper = rectangle_lattice([np.linspace(-1.0, 1.0, 4 * cells + 1), np.linspace(0.0, 1.0, 2 * cells + 1)])
    lower = rectangle_lattice([np.linspace(-3.0, 3.0, 9 * cells + 1), np.linspace(-3.0, 0.0, 4 * cells + 1)])
    pair = ContactPair(Surface("upper", "y0"), Surface("lower", "y1"))
    assert pair.discretisation == "best"
    supports = [Support("lower", "y0", (0.0, 0.0)), Support("upper", "y1", (0.0, -0.02))]
    return Scene({"upper": Body(upper, RUBBER), "lower": Body(lower, RUBBER)}, supports, contacts=[pair])


def curved(cells: int = 6) -> Scene:
    """Two round blocks with meshes that do not match: facets leave gaps that the surfaces have not."""
    upper = rectangle((0.0, 0.0), (1.0, 1.0), (cells, cells))
    lower = rectangle((-0.2, -1.0), (1.3, 0.0), (2 * cells - 1, cells))
    x, y = upper.points.T
    upper = upper.moved(np.column_stack([x, y + 0.1 * x**2 * (1.0 - y)]))
    x, y = lower.points.T
    lower = lower.moved(np.column_stack([x, y - 0.1 * (x - 0.1) ** 2 * (1.0 + y)]))
    pair = ContactPair(Surface("upper", "y0"), Surface("lower", "y1"), discretisation="node")
    supports = [Support("lower", "y0", (0.0, 0.0)), Support("upper", "y1", (0.0, -0.03))]
    return Scene({"upper": Body(upper, RUBBER), "lower": Body(lower, RUBBER)}, supports, contacts=[pair])


def on_floor_in_space() -> Scene:
    """A block between two planes of symmetry on a rough floor: at its sides one tangent is held."""
    mesh = block((0.0, 0.0, 0.0), (2.0, 1.0, 1.0), (4, 2, 2))
    load = Traction("block", "z1", lambda x: np.outer(1.0 + 0.3 * x[:, 0], [8.0, 0.0, -20.0]))
    sides = [Support("block", "x0", (0.0, None, None)), Support("block", "y0", (None, 0.0, None))]
    pair = ContactPair(Surface("block", "z0"), RigidPlane((0, 0, 0), (0, 0, 1)), Coulomb(0.3))
    return Scene({"block": Body(mesh, IsotropicElasticity(1000.0, 0.3))}, sides, [load], contacts=[pair])


def under_a_ball() -> Scene:
    """A quarter of a body that is lifted against a rigid ball: 22 nodes touch."""
    line = np.interp(np.arange(13) / 4.0, np.arange(4), [0.0, 1.5, 3.75, 9.0])
    planes = [Support("body", "x0", (0.0, None, None)), Support("body", "y0", (None, 0.0, None))]
    pair = ContactPair(Surface("body", "z1"), RigidSphere((0.0, 0.0, 50.0), 50.0))
    body = Body(box_lattice([line, line, -line[::-1]]), IsotropicElasticity(1000.0, 0.3))
    lifted = Support("body", "z0", (0.0, 0.0, 0.05))
    return Scene({"body": body}, [*planes, lifted], contacts=[pair])


def hanging(n: int = 3, load: Load | None = None, part: Callable[..., BodyMesh] = half_disc) -> Scene:
    """A disc or a ball of radius one, held at half its height: its volume lies below, between facets."""
    mesh, dim = part(1.0, n, grading=1.0, symmetry="x"), 2 if part is half_disc else 3
    material = RUBBER if dim == 2 else IsotropicElasticity(1000.0, 0.3)
    side, top = ([0.0 if axis == held else None for axis in range(dim)] for held in (0, dim - 1))
    supports = [Support("roll", "x0", tuple(side)), Support("roll", "top", tuple(top))]
    if dim == 3:
        supports.append(Support("roll", "top", (None, 0.0, None)))
    weight = BodyForce("roll", (0.0,) * (dim - 1) + (-5.0,))
    return Scene({"roll": Body(mesh, material)}, supports, [load or weight])


def parts_of_hanging(comm: MPI.Comm) -> np.ndarray:
    """The energy of a disc that hangs, its errors by mesh and geometry, and the shares of its cells."""
    scene = hanging()
    cuts = {"roll": bisection_partition(scene.bodies["roll"].mesh, 2)}
    state = ContactProblem(scene, comm, partitions=cuts, tolerance=1e-10).solve(adjoint=True)
    found = goal_error(state, StrainEnergy(), tolerance=1e-8)
    return np.array([found.value, found.mesh, found.geometry, *found.by_cell("roll")])


def parts_of(comm: MPI.Comm) -> np.ndarray:
    """The largest pressure under a punch, its error and the shares of cells."""
    scene = punched(1)
    cuts = {name: bisection_partition(body.mesh, 2) for name, body in scene.bodies.items()}
    state = solve_scene(scene, comm, partitions=cuts, tolerance=1e-10)
    found = goal_error(state, LargestPressure(), tolerance=1e-8)
    return np.array([found.value, found.mesh, found.uncancelled, *found.by_cell("lower")])
