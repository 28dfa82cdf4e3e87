"""A block on a strip, held in two ways on the two halves of the strip."""

from __future__ import annotations

from dataclasses import replace

from mpi4py import MPI

from benchmarks.graph_partition import graph_partition
from fenics_contact import (
    Body,
    ContactPair,
    Coulomb,
    RigidSurface,
    Scene,
    State,
    Support,
    Surface,
    Tie,
    solve_scene,
)
from fenics_contact.gallery import rectangle
from fenics_contact.materials import PlaneStrain

MATERIAL = PlaneStrain(1.0, 0.3)
TOP, TIED, FREE = Surface("up", "y0"), Surface("low", "tied"), Surface("low", "free")


def half_tied(columns: int, discretisation: str, sliding: bool) -> Scene:
    """A block on a strip, tied on its left half and in contact with friction on its right one."""
    low, up = rectangle((0, 0), (2, 0.4), (6, 2)), rectangle((0, 0.4), (2, 1.2), (columns, 3))
    facets = low.surfaces["y1"]
    left = low.points[facets].mean(axis=1)[:, 0] < 1.0
    low = replace(low, surfaces={**low.surfaces, "tied": facets[left], "free": facets[~left]})
    return Scene(
        {"low": Body(low, MATERIAL), "up": Body(up, MATERIAL)},
        [
            Support("low", "y0"),
            RigidSurface("up", "y1", (0.7, 1.5), force=(1e-3, -1e-2), moment=-4e-4),
        ],
        contacts=[ContactPair(FREE, TOP, Coulomb(0.4), discretisation)],
        ties=[Tie(TIED, TOP, sliding=sliding, discretisation=discretisation)],
    )


def solved(scene: Scene, parts: tuple[int, int]) -> State:
    counts = dict(zip(scene.bodies, parts, strict=True))
    cut = {name: graph_partition(body.mesh, counts[name]) for name, body in scene.bodies.items()}
    return solve_scene(scene, MPI.COMM_SELF, partitions=cut, tolerance=1e-10)
