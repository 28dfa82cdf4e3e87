"""Refinement of simplices by dolfinx: edges are halved until the mesh fits together again."""

from __future__ import annotations

import numpy as np

from fenics_contact._dolfinx.loading import dolfinx, old
from fenics_contact._dolfinx.meshes import local_mesh
from fenics_contact._dolfinx.numbering import cell_geometry, input_cells


def halved_simplices(
    points: np.ndarray, cells: np.ndarray, cell_type: str, marked: np.ndarray
) -> tuple[np.ndarray, np.ndarray]:
    """Return a mesh in which all edges of the marked cells are halved, and as many others as that takes.

    Every cell with a halved edge has its longest one halved, too, so that angles stay bounded (A. Plaza, G.F.
    Carey, Applied Numerical Mathematics 32, 2000). New nodes are midpoints of edges. Coordinates and cells
    are in an order of dolfinx's own.
    """
    dim = points.shape[1]
    mesh = local_mesh(points, cells, cell_type)
    mesh.topology.create_entities(1)
    mesh.topology.create_connectivity(dim, 1)
    edges = np.asarray(mesh.topology.connectivity(dim, 1).array).reshape(len(cells), -1)
    chosen = np.unique(edges[np.isin(input_cells(mesh), marked)]).astype(np.int32)
    if old():
        fine = dolfinx.mesh.refine(mesh, chosen, redistribute=False)
    else:
        fine = dolfinx.mesh.refine(mesh, chosen)[0]
    return np.array(fine.geometry.x[:, :dim]), cell_geometry(fine).astype(np.int64)
