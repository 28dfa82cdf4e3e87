"""Contact of moved bodies on several ranks; run under mpirun, stores what every rank got."""

from __future__ import annotations

import sys

import numpy as np
from mpi4py import MPI

from fenics_contact import ContactPair, DistanceObstacle, Scene, Surface
from fenics_contact._pairing.sliding.contact import SlidingContact
from fenics_contact.errors import UserCodeError
from tests.pairing.sliding_scenes import free, on_arch, shaken

Numbers = dict[str, np.ndarray]


def collect(comm: MPI.Comm) -> Numbers:
    """Slide bodies over an arch, and find what depends on their points."""
    numbers = {}
    for kind in ("tetrahedron", "quadrilateral"):
        scene = on_arch(kind)
        contact, x = SlidingContact.of(scene, free(scene), comm), shaken(scene)
        first = contact.at(x)
        x[: scene.bodies["high"].mesh.n_nodes, 0] += 0.3
        now = contact.at(x, first)
        numbers |= {
            f"{kind} key": now.key,
            f"{kind} facet": now.points.facet,
            f"{kind} gap": now.points.gap,
            f"{kind} weights": now.points.master.toarray(),
            f"{kind} slip": now.slip(first.material_points()),
            f"{kind} values": now.stiffness(np.ones(now.points.count)).values,
        }
    return numbers


def message_of_an_obstacle_that_fails_on_one_rank(comm: MPI.Comm) -> str:
    """Ask an obstacle whose distance only the last rank cannot tell."""

    def distance(x: np.ndarray) -> np.ndarray:
        if comm.rank == comm.size - 1:
            raise RuntimeError("no idea")
        return x[:, 2]

    body = on_arch("tetrahedron").bodies["high"]
    scene = Scene({"high": body}, contacts=[ContactPair(Surface("high", "z0"), DistanceObstacle(distance))])
    try:
        SlidingContact.of(scene, free(scene), comm).at(scene.points)
    except UserCodeError as error:
        return str(error)
    return "nothing was raised"


if __name__ == "__main__":
    world = MPI.COMM_WORLD
    numbers, message = collect(world), message_of_an_obstacle_that_fails_on_one_rank(world)
    everywhere = world.gather((numbers, message), root=0)
    if everywhere is not None:
        for mine, _ in everywhere[1:]:
            assert all(np.array_equal(mine[key], numbers[key]) for key in numbers), "ranks differ"
        np.savez(sys.argv[1], messages=np.array([text for _, text in everywhere]), **numbers)
