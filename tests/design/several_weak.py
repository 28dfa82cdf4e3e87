"""Blocks of which several points touch a floor without force."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np
from mpi4py import MPI

from fenics_contact import (
    Body,
    Checkpoint,
    ContactPair,
    ContactProblem,
    Scene,
    ShapeProblem,
    Support,
    Surface,
    SurfaceDesign,
    minimize,
)
from fenics_contact.design import BundleTrust, ContactForces, Result
from fenics_contact.gallery import DesignSurface, block
from fenics_contact.materials import IsotropicElasticity
from fenics_contact.results import ContactResult
from tests.scenes import FLOOR, Friction, partitions

Array = np.ndarray
BOUND = 0.01


def block_on_its_ends(friction: Friction = None) -> Scene:
    """A block that is held on top; below, all nodes of both ends touch the floor and the middle does not."""
    mesh = block((0.0, 0.0, 0.0), (2.0, 1.0, 1.0), (2, 3, 2))
    points = mesh.points.copy()
    points[np.isclose(points[:, 0], 1.0) & np.isclose(points[:, 2], 0.0), 2] += 0.05
    return Scene(
        {"block": Body(mesh.moved(points), IsotropicElasticity(100.0, 0.3))},
        [Support("block", "z1")],
        contacts=[ContactPair(Surface("block", "z0"), FLOOR, friction)],
    )


def seesaw(scene: Scene, net: tuple[int, int]) -> SurfaceDesign:
    """One end goes down where the other goes up."""
    mesh = scene.bodies["block"].mesh
    nodes = np.unique(mesh.surfaces["z0"])
    x, y = mesh.points[nodes, 0].round(9), mesh.points[nodes, 1].round(9)
    order = np.lexsort((y, x))
    nodes, x, y = nodes[order], x[order], y[order]
    directions = np.zeros((len(nodes), 3))
    directions[:, 2] = np.where(x > 1.5, 1.0, -1.0)
    return SurfaceDesign("block", DesignSurface(nodes, np.column_stack([x / 2, y]), directions, (3, 4)), net)


def posed(
    comm: MPI.Comm, *, net: tuple[int, int] = (1, 1), friction: Friction = None, **more: Any
) -> ShapeProblem:
    """The force on one end minus that on the other: smooth, though every node opens or closes."""
    scene = block_on_its_ends(friction)
    places = scene.bodies["block"].mesh.points

    def force(contact: ContactResult) -> tuple[float, Array, Array]:
        x = places[contact.points.slave, 0]
        sign = np.where(x < 0.5, 1.0, np.where(x > 1.5, -1.0, 0.0))
        return float(sign @ contact.normal_force), sign, np.zeros((len(sign), 2))

    design = seesaw(scene, net)
    return ShapeProblem(
        ContactProblem(scene, comm, partitions=partitions(scene)), design, ContactForces(force), **more
    )


def minimised(problem: ShapeProblem, checkpoint: Checkpoint | None = None, **limits: Any) -> Result:
    bounds = (-BOUND * np.ones(problem.size), BOUND * np.ones(problem.size))
    return minimize(
        problem, np.zeros(problem.size), BundleTrust(**limits), bounds=bounds, checkpoint=checkpoint
    )


def collect(comm: MPI.Comm, path: Path | None = None) -> dict[str, Any]:
    """Minimise from the start, or go on from a checkpoint. Collective."""
    problem = posed(comm, net=(2, 2))
    result = minimised(problem, None if path is None else Checkpoint(path, resume=True))
    return {
        "ranks": comm.size,
        "x": result.x.tolist(),
        "values": [record.value for record in result.history],
        "kinds": [record.kind.name for record in result.history],
        "reason": result.reason.name,
        "same": len(set(comm.allgather(result.x.tobytes()))) == 1,
    }
