"""Distributed meshes with cells dealt out in several ways; under mpirun, writes what each rank found."""

from __future__ import annotations

import json
import sys
from typing import Any

import numpy as np
from mpi4py import MPI

from fenics_contact import _dolfinx
from tests.dolfinx.samples import CELLS, Sample, box


def owners(mesh: Sample, ranks: int) -> dict[str, np.ndarray]:
    """Ways to deal the cells out; under all but the first some rank has none."""
    even = np.arange(len(mesh.cells)) * ranks // len(mesh.cells)
    scattered = np.random.default_rng(1).integers(0, ranks, len(mesh.cells))
    return {
        "even": even,
        "scattered": scattered,
        "first rank empty": np.maximum(even, 1),
        "last rank empty": np.minimum(even, ranks - 2),
        "all on the last": np.full(len(mesh.cells), ranks - 1),
    }


def look_at(comm: MPI.Comm, cell: str, mesh: Sample, rank: np.ndarray) -> dict[str, Any]:
    """Build the mesh and a field, and report what this rank holds."""
    own = _dolfinx.rank_mesh(comm, mesh.points, mesh.cells, rank, cell)
    cell_map = own.topology.index_map(mesh.dim)
    nodes_of_cells = _dolfinx.cell_nodes(own)[: cell_map.size_local]
    expected = np.sort(mesh.cells[rank == comm.rank], axis=1)
    cells_stay = {tuple(row) for row in np.sort(nodes_of_cells, axis=1)} == {tuple(row) for row in expected}
    field = _dolfinx.coefficient(own, "u")
    nodes, dofs = _dolfinx.node_dofs(field.function_space)
    dof_map = field.function_space.dofmap.index_map
    place = field.function_space.tabulate_dof_coordinates()[dofs, : mesh.dim]
    values = field.x.array.reshape(-1, mesh.dim)
    values[:] = np.nan
    held = dofs < dof_map.size_local  # only the owner knows; the others hear of it
    values[dofs[held]] = np.sin(nodes[held])[:, None]
    field.x.scatter_forward()
    return {
        "cells stay": cells_stay,
        "cells": int(cell_map.size_local),
        "all cells": int(cell_map.size_global),
        "all nodes": int(dof_map.size_global),
        "misplaced": float(np.abs(place - mesh.points[nodes]).max(initial=0.0)),
        "unheard": float(np.abs(values[dofs] - np.sin(nodes)[:, None]).max(initial=0.0)),
        "owned nodes": nodes[held].tolist(),
    }


def main() -> None:
    comm = MPI.COMM_WORLD
    found = {}
    for cell in CELLS:
        mesh = box(cell, (2, 1, 1), (4, 3, 3))
        for name, rank in owners(mesh, comm.size).items():
            found[f"{cell}, {name}"] = comm.gather(look_at(comm, cell, mesh, rank))
    if comm.rank == 0:
        sys.stdout.write(json.dumps(found))


if __name__ == "__main__":
    main()
