"""Scenes that cannot be solved, on several ranks; run under mpirun, writes as JSON what every rank raised."""

from __future__ import annotations

import json
import sys
from collections.abc import Callable
from dataclasses import replace

import numpy as np
import ufl
from mpi4py import MPI

from fenics_contact import (
    Body,
    ContactPair,
    RigidPlane,
    Scene,
    Support,
    Surface,
    Traction,
    Ufl,
    box_partition,
    solve_scene,
)
from fenics_contact.gallery import block
from fenics_contact.materials import IsotropicElasticity
from tests.feti.scenes import STEEL, Cut

BAR = block((0, 0, 0), (1, 1, 6), (2, 2, 6))


def bar(**parts: object) -> Cut:
    """A bar in six subdomains, one above the other, clamped below unless told otherwise."""
    scene = Scene({"bar": Body(BAR, STEEL)}, supports=[Support("bar", "z0")])
    return replace(scene, **parts), {"bar": box_partition(BAR, (1, 1, 6))}  # type: ignore[arg-type]


def too_few_subdomains() -> Cut:
    scene, _ = bar()
    return scene, {"bar": box_partition(BAR, (1, 1, 2))}


def infinite_load_on_the_last_rank() -> Cut:
    load = Traction("bar", "z1", Ufl(lambda x: ufl.as_vector((0.0, 0.0, 1e308))))
    wide = BAR.moved(BAR.points * [1e2, 1e2, 1.0])
    scene, partitions = bar(loads=[load], bodies={"bar": Body(wide, STEEL)})
    return scene, partitions


def infinite_stiffness() -> Cut:
    _, partitions = bar()
    hard = Body(BAR, IsotropicElasticity(1e308, 0.49))
    scene = Scene({"bar": Body(BAR, STEEL), "hard": hard}, [Support("bar", "z0"), Support("hard", "z0")])
    return scene, {**partitions, "hard": np.zeros(BAR.n_cells, dtype=int)}


def nothing_holds_it() -> Cut:
    return bar(supports=[], loads=[Traction("bar", "x1", (1.0, 0.0, 0.0))])


def pulled_off_the_floor() -> Cut:
    floor = ContactPair(Surface("bar", "z0"), RigidPlane((0, 0, 0), (0, 0, 1)))
    return bar(supports=[], loads=[Traction("bar", "z1", (0.0, 0.0, 1.0))], contacts=[floor])


def overlap() -> Cut:
    floor = ContactPair(Surface("bar", "z0"), RigidPlane((0, 0, 0.7), (0, 0, 1)))
    return bar(supports=[Support("bar", "z1")], contacts=[floor])


def a_partition_of_another_mesh() -> Cut:
    scene, partitions = bar()
    return scene, {"bar": partitions["bar"][:-1]}


def a_subdomain_in_two_pieces() -> Cut:
    scene, partitions = bar()
    return scene, {"bar": np.where(partitions["bar"] == 5, 0, partitions["bar"])}


def clashing_supports() -> Cut:
    return bar(supports=[Support("bar", "z0"), Support("bar", "x0", (1.0, None, None))])


CASES: tuple[Callable[[], Cut], ...] = (
    too_few_subdomains,
    infinite_load_on_the_last_rank,
    infinite_stiffness,
    nothing_holds_it,
    pulled_off_the_floor,
    overlap,
    a_partition_of_another_mesh,
    a_subdomain_in_two_pieces,
    clashing_supports,
)


def attempt(make: Callable[[], Cut], comm: MPI.Comm) -> tuple[str, str]:
    """Return class and message of what this rank raises."""
    try:
        scene, partitions = make()
        solve_scene(scene, comm, partitions=partitions)
    except Exception as error:
        return type(error).__name__, str(error)
    return "nothing", ""


if __name__ == "__main__":
    raised = {make.__name__: MPI.COMM_WORLD.gather(attempt(make, MPI.COMM_WORLD)) for make in CASES}
    if MPI.COMM_WORLD.rank == 0:
        sys.stdout.write("\n" + json.dumps(raised))
