"""Blocks whose faces are designs: on a rigid floor, on one another, of either cell type."""

from __future__ import annotations

from typing import Any

import numpy as np
from mpi4py import MPI

from fenics_contact import (
    Body,
    BodyForce,
    BodyMesh,
    ContactPair,
    ContactProblem,
    Scene,
    Support,
    Surface,
    SurfaceDesign,
    Traction,
)
from fenics_contact.design import TotalPotential
from fenics_contact.gallery import DesignSurface, block
from fenics_contact.materials import IsotropicElasticity
from tests.design.chains import SOLVER
from tests.design.quotients import Remembering
from tests.scenes import FLOOR, Friction, crowned, partitions

RUBBER, PLASTIC = IsotropicElasticity(100.0, 0.3), IsotropicElasticity(300.0, 0.2)


def side(mesh: BodyMesh, name: str) -> DesignSurface:
    """The face "z0" or "z1" of a block as a surface that moves along z."""
    nodes = np.unique(mesh.surfaces[name])
    x, y = mesh.points[nodes, 0].round(9), mesh.points[nodes, 1].round(9)
    order = np.lexsort((y, x))
    ticks = [np.unique(c) for c in (x, y)]
    parameters = np.column_stack([(c - c.min()) / np.ptp(c) for c in (x, y)])
    outward = np.array([0.0, 0.0, 1.0 if name == "z1" else -1.0])
    counts = (len(ticks[0]), len(ticks[1]))
    return DesignSurface(nodes[order], parameters[order], np.tile(outward, (len(nodes), 1)), counts)


def block_on_floor(
    friction: Friction, cell: str = "hexahedron", *, load: tuple[float, float, float]
) -> Scene:
    """A crowned block that nothing but a rigid floor holds, loaded on top."""
    mesh = crowned(block((0.0, 0.0, 0.0), (2.0, 1.0, 1.0), (6, 3, 3), cell), 0.02)
    return Scene(
        {"block": Body(mesh, RUBBER)},
        loads=[Traction("block", "z1", load)],
        contacts=[ContactPair(Surface("block", "z0"), FLOOR, friction)],
    )


def block_on_block(
    friction: Friction, cell: str = "hexahedron", *, load: tuple[float, float, float]
) -> Scene:
    """A heavy crowned block that only the one under it holds; no node lies over an edge of a facet."""
    lower = block((0.0, 0.0, -1.0), (2.0, 1.2, 0.0), (5, 4, 2), cell)
    upper = crowned(block((0.13, 0.07, 0.0), (1.87, 1.09, 0.8), (6, 4, 2), cell), 0.04)
    return Scene(
        {"lower": Body(lower, PLASTIC), "upper": Body(upper, RUBBER)},
        [Support("lower", "z0")],
        [Traction("upper", "z1", load), BodyForce("upper", (0.1, 0.0, -1.0))],
        [ContactPair(Surface("upper", "z0"), Surface("lower", "z1"), friction, discretisation="node")],
    )


def designs_of(scene: Scene) -> tuple[SurfaceDesign, ...]:
    """All contact surfaces of a scene of blocks move."""
    surfaces = [s for pair in scene.contacts for s in (pair.slave, pair.master) if isinstance(s, Surface)]
    return tuple(SurfaceDesign(s.body, side(scene.bodies[s.body].mesh, s.name), (3, 2)) for s in surfaces)


def problem(scene: Scene, comm: MPI.Comm = MPI.COMM_SELF, **more: Any) -> Remembering:
    contact = ContactProblem(scene, comm, partitions=partitions(scene), solver=SOLVER)
    return Remembering(contact, designs_of(scene), TotalPotential(), **more)
