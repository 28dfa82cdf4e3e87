"""Meshes on one rank or on all, built from arrays of nodes and cells."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np
import scipy.sparse as sp
import ufl

from fenics_contact._base.libraries import MPI
from fenics_contact._dolfinx.cells import NODE_ORDER, dimension
from fenics_contact._dolfinx.loading import cpp, dolfinx, old
from fenics_contact._dolfinx.templates import vector_element


def _partitioner(destinations: cpp.graph.AdjacencyList_int32) -> Callable[..., cpp.graph.AdjacencyList_int32]:
    """Send every cell to the ranks in its row of ``destinations``, the first of which owns it."""
    if old():
        return lambda comm, parts, tdim, cells, ghost_mode: destinations
    return lambda comm, parts, cell_types, cells: destinations


def local_mesh(points: np.ndarray, cells: np.ndarray, cell_type: str) -> dolfinx.mesh.Mesh:
    """Build a mesh on this rank only.

    `cells`: rows of node numbers in VTK order.
    """
    return _create_mesh(MPI.COMM_SELF, points, cells, cell_type, np.zeros((len(cells), 1), dtype=np.int32))


def rank_mesh(
    comm: MPI.Comm, points: np.ndarray, cells: np.ndarray, rank: np.ndarray, cell_type: str
) -> dolfinx.mesh.Mesh:
    """Build a distributed mesh with cells on given ranks; a rank may have none. Collective on ``comm``."""
    bounds = np.linspace(0, len(points), comm.size + 1).astype(int)
    mine = np.flatnonzero(rank == comm.rank)
    destinations: tuple[np.ndarray, ...] = (np.full((len(mine), 1), comm.rank, dtype=np.int32),)
    if old() and comm.size > 1:
        destinations = _with_ghosts(cells, rank, mine, comm.rank)
    part = points[bounds[comm.rank] : bounds[comm.rank + 1]]
    return _create_mesh(comm, part, cells[mine], cell_type, *destinations)


def _with_ghosts(cells: np.ndarray, rank: np.ndarray, mine: np.ndarray, here: int) -> tuple[np.ndarray, ...]:
    """Send each cell to its owner and to all ranks around it: their numbers, and where those of a cell begin.

    dolfinx 0.5 detects that two ranks share a vertex only through a ghost cell.
    """
    vertices = cells.shape[1]
    touching = sp.csr_matrix((np.ones(cells.size), (cells.ravel(), np.repeat(rank, vertices))))
    reached = touching[cells[mine].ravel()].tocoo()
    cell, to = np.unique([reached.row // vertices, reached.col], axis=1)
    order = np.lexsort((to, to != here, cell))  # the owner comes first
    offsets = np.concatenate([[0], np.cumsum(np.bincount(cell, minlength=len(mine)))])
    return to[order].astype(np.int32), offsets.astype(np.int32)


def _create_mesh(
    comm: MPI.Comm, points: np.ndarray, cells: np.ndarray, cell_type: str, *destinations: np.ndarray
) -> dolfinx.mesh.Mesh:
    ordered = np.ascontiguousarray(cells[:, NODE_ORDER[cell_type]], dtype=np.int64)
    points = np.ascontiguousarray(points, dtype=np.float64).reshape(-1, dimension(cell_type))
    element = vector_element(cell_type)
    partitioner = _partitioner(cpp.graph.AdjacencyList_int32(*destinations))
    if old():
        adjacency, ghost_mode = cpp.graph.AdjacencyList_int64(ordered), cpp.mesh.GhostMode.shared_facet
        return dolfinx.mesh.create_mesh(comm, adjacency, points, ufl.Mesh(element), ghost_mode, partitioner)
    return dolfinx.mesh.create_mesh(comm, cells=ordered, x=points, e=element, partitioner=partitioner)
