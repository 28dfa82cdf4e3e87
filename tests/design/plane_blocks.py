"""Plane blocks whose edges are designs, and how their states follow."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from functools import cache

import numpy as np
from mpi4py import MPI

from fenics_contact import (
    Body,
    BodyForce,
    BodyMesh,
    ContactPair,
    ContactProblem,
    Coulomb,
    RigidPlane,
    RigidSphere,
    Scene,
    Support,
    Surface,
    SurfaceDesign,
    Traction,
    Tresca,
)
from fenics_contact.design import TotalPotential
from fenics_contact.gallery import rectangle
from fenics_contact.materials import PlaneStrain, PlaneStress
from fenics_contact.mesh import quadratic
from tests.design.aims import aims
from tests.design.chains import SOLVER
from tests.design.objectives import objectives
from tests.design.quotients import Line, Remembering
from tests.scenes import Friction, RigidObstacle, crowned, partitions

RUBBER, PLASTIC = PlaneStrain(100.0, 0.3), PlaneStress(300.0, 0.2)
FLOOR = RigidPlane((0.0, 0.0), (0.0, 1.0))
PIPE = RigidSphere((1.1, -6.0), 6.0)


def on_obstacle(friction: Friction, cell: str, obstacle: RigidObstacle = FLOOR, order: int = 1) -> Scene:
    """A crowned block that nothing but an obstacle holds, pressed and pushed on top."""
    mesh = _of_order(order, rectangle((0.0, 0.0), (2.0, 1.0), (10, 4), cell))
    mesh = crowned(mesh, 0.02 if obstacle is FLOOR else -0.04)
    lowest = obstacle.distance(mesh.points[np.unique(mesh.surfaces["y0"])]).min()
    mesh = mesh.moved(mesh.points - (0.0, lowest))
    return Scene(
        {"block": Body(mesh, RUBBER)},
        loads=[Traction("block", "y1", (0.45, -2.0))],
        contacts=[ContactPair(Surface("block", "y0"), obstacle, friction)],
    )


def on_block(friction: Friction, cell: str, order: int = 1) -> Scene:
    """A heavy crowned block that only the rounded one under it holds; no node lies over an end of an edge."""
    lower = _of_order(order, rectangle((0.0, -1.0), (2.0, 0.0), (7, 3), cell))
    x, y = lower.points.T
    lower = lower.moved(np.column_stack([x, y - 0.02 * (x - 1.0) ** 2 * (y + 1.0)]))
    upper = crowned(_of_order(order, rectangle((0.13, 0.0), (1.87, 0.8), (9, 3), cell)), 0.04)
    return Scene(
        {"lower": Body(lower, PLASTIC), "block": Body(upper, RUBBER)},
        [Support("lower", "y0")],
        [Traction("block", "y1", (0.6, -2.0)), BodyForce("block", (0.1, -1.0))],
        [ContactPair(Surface("block", "y0"), Surface("lower", "y1"), friction, discretisation="node")],
    )


def _of_order(order: int, mesh: BodyMesh) -> BodyMesh:
    return quadratic(mesh) if order == 2 else mesh


SCENES: dict[str, Callable[[], Scene]] = {
    "floor": lambda: on_obstacle(Coulomb(0.3), "quadrilateral"),
    "floor, Tresca, triangles": lambda: on_obstacle(Tresca(0.6), "triangle"),
    "pipe": lambda: on_obstacle(Coulomb(0.3), "triangle", PIPE),
    "blocks": lambda: on_block(Coulomb(0.38), "quadrilateral"),
    "blocks, triangles": lambda: on_block(Coulomb(0.38), "triangle"),
    "blocks, Tresca": lambda: on_block(Tresca(0.8), "quadrilateral"),
}
OBJECTIVES = {**objectives("block"), **aims("block", "y0", 2)}


def plane_problem(
    scene: Scene, comm: MPI.Comm = MPI.COMM_SELF, also: Sequence[Surface] = (), cuts: int = 2
) -> Remembering:
    """All contact curves, or surfaces, of a scene move, and others."""
    surfaces = [s for pair in scene.contacts for s in (pair.slave, pair.master) if isinstance(s, Surface)]
    net = 5 if scene.dim == 2 else (3, 2)
    designs = tuple(SurfaceDesign(s.body, s.name, net) for s in (*surfaces, *also))
    contact = ContactProblem(
        scene, comm, partitions=partitions(scene, (cuts, 1, 1)), solver=SOLVER.with_tolerance(1e-12)
    )
    return Remembering(contact, designs, TotalPotential())


def line_of(scene: Scene, way: int = 6, also: Sequence[Surface] = ()) -> Line:
    blocks = plane_problem(scene, also=also)
    alpha = 0.004 * np.random.default_rng(1).standard_normal(blocks.size)
    return Line(blocks, alpha, np.random.default_rng(way).standard_normal(blocks.size), 1e-5)


@cache
def line(name: str) -> Line:
    return line_of(SCENES[name]())
