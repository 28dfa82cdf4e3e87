"""Scenes whose costs are counted: a bar without contact, a block that sticks and slips on a plane."""

from __future__ import annotations

from pathlib import Path
from time import perf_counter
from typing import Any

import numpy as np
from mpi4py import MPI

from fenics_contact import (
    Body,
    ContactPair,
    Coulomb,
    RigidPlane,
    Scene,
    Support,
    Surface,
    Traction,
    box_partition,
    solve_scene,
    write_result,
    write_vtu,
)
from fenics_contact.errors import InvalidInputError
from fenics_contact.gallery import block, rectangle
from fenics_contact.materials import IsotropicElasticity, PlaneStrain


def bar() -> Scene:
    """Return a plane bar that is clamped at one end and pulled at the other, without contact."""
    body = Body(rectangle((0, 0), (4, 1), (16, 4)), PlaneStrain(1.0, 0.3))
    return Scene({"bar": body}, [Support("bar", "x0")], [Traction("bar", "x1", (0.0, 1e-4))])


def pressed_block(cells: tuple[int, int, int] = (9, 8, 8)) -> Scene:
    """Return a block that is clamped at one end, pressed and dragged over a plane: some nodes stick."""
    body = Body(block((0, 0, 0), (2, 1, 1), cells), IsotropicElasticity(1.0, 0.3))
    plane = RigidPlane((0, 0, -0.002), (0, 0, 1))
    contact = ContactPair(Surface("block", "z0"), plane, Coulomb(0.3))
    return Scene(
        {"block": body},
        [Support("block", "x0")],
        [Traction("block", "z1", (0.002, 0.001, -0.005))],
        [contact],
    )


def whole_way(comm: MPI.Comm, folder: Path) -> dict[str, Any]:
    """Solve and recover on 64 subdomains, and return answers and what all ranks have counted. Collective."""
    begun, scene = perf_counter(), pressed_block()
    parts = {"block": box_partition(scene.bodies["block"].mesh, (4, 4, 4))}
    state = solve_scene(scene, comm, partitions=parts, tolerance=1e-10)
    order = np.argsort(state.contact.points.slave)
    answers = {
        "potential": state.energies.total_potential,
        "forces": state.contact.force[order].tolist(),
        "displacement": state.gather_displacement("block").tolist(),
        "stress": state.gather_von_mises("block").tolist(),
        "reaction": state.reactions()["block x0"].force.tolist(),
        "status": np.bincount(state.contact.status, minlength=3).tolist(),
        "products": state.solution.products,
    }
    write_vtu(state, folder)
    write_result(state, folder)
    costs = comm.allgather(state.costs)
    total = [each.total for each in costs]
    return {
        **answers,
        "copied": max(each.largest_copy for each in total),
        "reduced": max(each.largest_reduction for each in total),
        "costs": [str(max(costs, key=lambda each: each.total.flops)), *map(str, costs[:1])],
        "seconds": perf_counter() - begun,
    }


def refused(comm: MPI.Comm) -> str:
    """Return the words by which fewer subdomains than ranks are refused on all of them. Collective."""
    scene, message = pressed_block(), ""
    parts = {"block": box_partition(scene.bodies["block"].mesh, (3, 4, 4))}
    try:
        solve_scene(scene, comm, partitions=parts)
    except InvalidInputError as error:
        message = str(error).partition(" (met on")[0]
    words = set(comm.allgather(message))
    return " | ".join(sorted(words))
