"""Tables of a scene that ranks hold together, and its answers; run under mpirun, writes JSON."""

from __future__ import annotations

import gc
import json
import sys
from dataclasses import replace
from typing import Any

import numpy as np
from mpi4py import MPI

from fenics_contact import LinearState, Scene, box_partition, solve_scene
from fenics_contact._base.shared import _Packed, is_shared, once_a_machine
from fenics_contact.mesh import quadratic
from tests.base.shared_on_ranks import mapped
from tests.ranks.counted import pressed_block

#: Order of cells, and whether the scene is made once a machine.
CASES = {"linear": (1, False), "quadratic": (2, False), "made once": (1, True)}


def tables(state: LinearState) -> dict[str, np.ndarray]:
    """Return the tables of nodes, cells, copies and rows of all subdomains."""
    decomposition, numbering = state.torn.decomposition, state.torn.numbering
    mesh, tearing = state.scene.bodies["block"].mesh, decomposition.tearing
    gluing = decomposition.gluing
    corners = {"corners": mesh.linear.points, "linear cells": mesh.linear.cells}
    return {
        "points": mesh.points,
        "cells": mesh.cells,
        **(corners if mesh.order == 2 else {}),
        "partition": decomposition.partitions["block"],
        "first copy": tearing.first_copy,
        "copies": tearing.copy_subdomain,
        "stiffness": tearing.copy_stiffness,
        "share": tearing.copy_share,
        "several": tearing.on_several_ranks,
        "fixed": decomposition.fixed,
        "rows": gluing.dof,
        "owners": gluing.rows.owner,
        "right": gluing.rows.right,
        "numbering": numbering.owner,
        "position": numbering.position(slice(None)),  # type: ignore[arg-type]
    }


def answers(comm: MPI.Comm, order: int = 1, once: bool = False) -> dict[str, Any]:
    """Solve a block that sticks and slips, and return answers and what is shared. Collective."""
    earlier = mapped()
    scene = of_quadratic_cells if order == 2 else lambda: pressed_block((6, 4, 4))
    given = once_a_machine(comm, scene) if once else scene()
    mesh = given.bodies["block"].mesh
    partitions = {"block": box_partition(mesh, (2, 2, 2))}
    state = solve_scene(given, comm, partitions=partitions, tolerance=1e-10)
    assert isinstance(state, LinearState)
    held, places = tables(state), np.argsort(state.contact.points.slave)
    found = {
        "shared": {name: is_shared(array) for name, array in held.items()},
        "writeable": [name for name, array in held.items() if array.flags.writeable],
        "files": mapped(earlier),
        "largest copy": state.costs.total.largest_copy,
        "bytes": sum(array.nbytes for array in held.values()),
        "potential": state.energies.total_potential,
        "forces": state.contact.force[places].tolist(),
        "displacement": state.gather_displacement("block").tolist(),
        "status": np.bincount(state.contact.status, minlength=3).tolist(),
    }
    del state, held, given, mesh, scene
    gc.collect()
    return {**found, "afterwards": list(mapped(earlier))}


def of_quadratic_cells() -> Scene:
    """Return a scene whose contact search has linear cells of its own."""
    scene = pressed_block((4, 2, 2))
    body = scene.bodies["block"]
    return replace(scene, bodies={"block": replace(body, mesh=quadratic(body.mesh))})


def main(comm: MPI.Comm) -> dict[str, list[dict[str, Any]]]:
    """Return the answers of all ranks by case. Collective."""
    known, _Packed.least = _Packed.least, 0  # of a small scene all is shared
    try:
        return {name: comm.allgather(answers(comm, *given)) for name, given in CASES.items()}
    finally:
        _Packed.least = known


if __name__ == "__main__":
    every = main(MPI.COMM_WORLD)
    if MPI.COMM_WORLD.rank == 0:
        sys.stdout.write(json.dumps(every))
