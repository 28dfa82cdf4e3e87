"""Linear scenes on several ranks against the monolithic answer; run under mpirun, writes JSON."""

from __future__ import annotations

import json
import sys
from typing import Any

import numpy as np
from mpi4py import MPI

from fenics_contact import Body, Scene, State, Support, Traction, _dolfinx, box_partition, solve_scene
from fenics_contact.gallery import block
from tests.fem import monolithic
from tests.fem.scenes import BOXES, cut, error, loaded_block, two_materials
from tests.feti.scenes import CELLS, STEEL


def stresses(state: State, body: str) -> dict[tuple[int, ...], float]:
    """Return the von Mises stress of this rank's cells by their nodes."""
    field = state.von_mises[body]
    mesh = field.function_space.mesh
    nodes = np.sort(_dolfinx.cell_nodes(mesh), axis=1)[: mesh.topology.index_map(3).size_local]
    dofs = np.asarray(
        getattr(field.function_space.dofmap.list, "array", field.function_space.dofmap.list)
    ).ravel()
    return {tuple(row): float(field.x.array[dof]) for row, dof in zip(nodes.tolist(), dofs, strict=False)}


def field_error(state: State, body: str, expected: np.ndarray) -> float:
    """Largest error of the displacement Function on this rank, relative; zero where it has no cell."""
    function = state.displacement[body]
    nodes, dofs = _dolfinx.node_dofs(function.function_space)
    difference = function.x.array.reshape(-1, 3)[dofs] - expected[nodes]
    return float(np.abs(difference).max(initial=0.0) / np.abs(expected).max())


def reference(scene: Scene, body: str, comm: MPI.Comm) -> np.ndarray:
    """Return the monolithic displacement, found by one rank. Collective."""
    return np.asarray(comm.bcast(monolithic.displacement(scene, body) if comm.rank == 0 else None))


def blocks(comm: MPI.Comm) -> dict[str, Any]:
    """Solve the loaded block for every cell type and number of subdomains that the ranks can share."""
    found = {}
    for cell in CELLS:
        scene = loaded_block(cell)
        expected = reference(scene, "block", comm)
        for subdomains in BOXES:
            if subdomains >= comm.size:
                state = solve_scene(scene, comm, partitions=cut(scene, subdomains), tolerance=1e-10)
                found[f"{cell} {subdomains}"] = {"error": error(state, "block", expected), **counted(state)}
    return found


def counted(state: State) -> dict[str, float]:
    return {"products": state.solution.products, "energy": state.energies.primal}


def bodies(comm: MPI.Comm) -> dict[str, Any]:
    """Solve two bodies such that some rank has no cell of one; compare the fields rank by rank."""
    scene, partitions = two_materials()
    partitions["stiff"] = np.zeros_like(partitions["stiff"])
    state, alone = (
        solve_scene(scene, comm, partitions=partitions, tolerance=1e-10),
        solve_scene(scene, MPI.COMM_SELF, partitions=partitions, tolerance=1e-10),
    )
    found: dict[str, Any] = counted(state)
    for name in scene.bodies:
        expected = reference(scene, name, comm)
        here, whole = stresses(state, name), stresses(alone, name)
        differences = [abs(here[cell] - whole[cell]) / max(whole.values()) for cell in here]
        found[name] = {
            "error": error(state, name, expected),
            "field": max(comm.allgather(field_error(state, name, expected))),
            "stress": max(comm.allgather(max(differences, default=0.0))),
            "cells": comm.allgather(len(here)),
            "all cells": len(whole),
        }
    return found


def bar(comm: MPI.Comm) -> dict[str, Any]:
    """Solve a clamped bar in one subdomain a rank: that of the last one owns no multiplier."""
    mesh = block((0, 0, 0), (1, 1, 4), (2, 2, 4))
    supports, loads = [Support("bar", "z0")], [Traction("bar", "z1", (1.0, 0.0, 1.0))]
    scene = Scene({"bar": Body(mesh, STEEL)}, supports, loads)
    state = solve_scene(
        scene, comm, partitions={"bar": box_partition(mesh, (1, 1, comm.size))}, tolerance=1e-10
    )
    owned = comm.allgather(len(state.system.torn.numbering.owned))
    return {"error": error(state, "bar", reference(scene, "bar", comm)), "owned": owned}


if __name__ == "__main__":
    world = MPI.COMM_WORLD
    answer = {"blocks": blocks(world), "bodies": bodies(world), "bar": bar(world)}
    if world.rank == 0:
        sys.stdout.write("\n" + json.dumps(answer))
