"""What must not depend on the number of ranks, in one script: run it under mpirun, or call `collect`."""

from __future__ import annotations

import json
import sys
from dataclasses import replace
from typing import Any

import numpy as np
from mpi4py import MPI

from fenics_contact import Body, Coulomb, Scene, Support, Traction, _dolfinx, solve_scene
from fenics_contact.errors import ConvergenceError, InfeasibleError
from fenics_contact.gallery import block
from fenics_contact.mesh import bisection_partition
from fenics_contact.qp import FaceNewton
from fenics_contact.results.deformed_state import AnyState
from tests.scenes import SOFT, block_on_plane, partitions, two_blocks

TOLERANCE = 1e-10
TENSION = 0.7


def cut_in_boxes(scene: Scene) -> dict[str, np.ndarray]:
    return partitions(scene, (2, 1, 1))


def cut_by_bisection(scene: Scene) -> dict[str, np.ndarray]:
    return {name: bisection_partition(body.mesh, 3) for name, body in scene.bodies.items()}


PARTITIONS = {"boxes": cut_in_boxes, "bisection": cut_by_bisection}


def uniaxial(cell: str) -> Scene:
    """A bar on rollers pulled along x by a traction: its von Mises stress is that traction, everywhere."""
    mesh = block((0.0, 0.0, 0.0), (2.0, 1.0, 1.0), (4, 2, 2), cell)
    rollers = [("x0", (0.0, None, None)), ("y0", (None, 0.0, None)), ("z0", (None, None, 0.0))]
    supports = [Support("bar", side, value) for side, value in rollers]
    return Scene({"bar": Body(mesh, SOFT)}, supports, [Traction("bar", "x1", (TENSION, 0.0, 0.0))])


def field_error(state: AnyState) -> float:
    """Return by how much displacement Functions differ from gathered nodal values, on this rank."""
    worst = 0.0
    for name, function in state.displacement.items():
        nodes, dofs = _dolfinx.node_dofs(function.function_space)
        expected = state.gather_displacement(name)[nodes]
        worst = max(worst, float(np.abs(function.x.array.reshape(-1, 3)[dofs] - expected).max(initial=0.0)))
    return worst


def position_error(state: AnyState) -> float:
    """Return by how much the points of the fields' meshes differ from the bodies' nodes, on this rank."""
    worst = 0.0
    for name, function in state.displacement.items():
        space = function.function_space
        nodes, dofs = _dolfinx.node_dofs(space)
        at = space.tabulate_dof_coordinates()[dofs]
        worst = max(worst, float(np.abs(at - state.scene.bodies[name].mesh.points[nodes]).max(initial=0.0)))
    return worst


def own_nodes(state: AnyState, body: str) -> int:
    """Return how many nodes of a body's field this rank owns; it may own none."""
    return int(state.displacement[body].function_space.dofmap.index_map.size_local)


def largest_stress(state: AnyState, body: str) -> float:
    """Return the largest von Mises stress on this rank's cells."""
    return float(state.von_mises[body].x.array.max(initial=0.0))


def contact_case(comm: MPI.Comm, cut: str) -> dict[str, Any]:
    scene = two_blocks(Coulomb(0.38))
    state = solve_scene(
        scene, comm, partitions=PARTITIONS[cut](scene), solver=FaceNewton(tolerance=TOLERANCE)
    )
    largest = max(np.abs(state.gather_displacement(name)).max() for name in scene.bodies)
    return {
        "objective": state.energies.total_potential,
        "gap": state.energies.primal - state.energies.dual,
        "force": state.contact.force.tolist(),
        "status": state.contact.status.tolist(),
        "subdomains": state.counts["subdomains"],
        "field error": comm.allreduce(field_error(state), MPI.MAX) / largest,
        "position error": comm.allreduce(position_error(state), MPI.MAX),
        "field nodes": [comm.allreduce(own_nodes(state, name)) for name in scene.bodies],
        "stress": [comm.allreduce(largest_stress(state, name), MPI.MAX) for name in scene.bodies],
    }


def uniaxial_case(comm: MPI.Comm, cell: str) -> dict[str, Any]:
    scene = uniaxial(cell)
    state = solve_scene(scene, comm, partitions=partitions(scene, (4, 1, 1)), tolerance=1e-10)
    space = state.von_mises["bar"].function_space
    own = space.dofmap.index_map.size_local
    stress = state.von_mises["bar"].x.array[:own]
    return {
        "cells": comm.allreduce(own),
        "stress error": comm.allreduce(float(np.abs(stress - TENSION).max(initial=0.0)), MPI.MAX),
        "elongation": float(state.gather_displacement("bar")[:, 0].max()),
        "primal": state.energies.primal,
        "dual": state.energies.dual,
        "contact points": state.contact.points.count,
    }


def refusals(comm: MPI.Comm) -> list[str]:
    """Return how each rank is told that a body is not held and that a solver was stopped."""
    loose = block_on_plane(Coulomb(0.3))
    lifted = replace(loose, loads=[Traction("block", "z1", (0.0, 0.0, 1.0))])
    said = []
    hasty = FaceNewton(max_steps=1)
    for scene, solver in ((loose, None), (lifted, None), (two_blocks(Coulomb(0.38)), hasty)):
        try:
            solve_scene(scene, comm, partitions=partitions(scene, (4, 1, 1)), solver=solver)
            said.append("nothing")
        except (InfeasibleError, ConvergenceError) as error:
            said.append(f"{type(error).__name__}: {error}")
    everyone = comm.allgather(said)
    assert len({len(words) for words in everyone}) == 1
    return [words for rank in everyone for words in rank]


def collect(comm: MPI.Comm) -> dict[str, Any]:
    """Run all cases. Collective."""
    return {
        "ranks": comm.size,
        "contact": {cut: contact_case(comm, cut) for cut in PARTITIONS},
        "uniaxial": {cell: uniaxial_case(comm, cell) for cell in ("hexahedron", "tetrahedron")},
        "refusals": refusals(comm),
    }


if __name__ == "__main__":
    answer = collect(MPI.COMM_WORLD)
    if MPI.COMM_WORLD.rank == 0:
        sys.stdout.write(json.dumps(answer))
