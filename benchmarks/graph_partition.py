"""Ragged subdomains by METIS, to see that answers do not depend on cuts and what plane cuts are worth.

METIS balances parts to the cell, which leaves jagged boundaries; it may return a disconnected part and, when
parts are small, one without cells. The graph is the dual one: a vertex for every cell, an edge for every face
that two cells share, weighted by its area.

References:
    G. Karypis, V. Kumar: A fast and high quality multilevel scheme for partitioning irregular graphs. SIAM J.
    Sci. Comput. 20 (1998).
"""

from __future__ import annotations

import os
import sys

import numpy as np
from scipy.sparse import coo_matrix, csr_matrix
from scipy.sparse.csgraph import breadth_first_order

from fenics_contact import BodyMesh
from fenics_contact.mesh.partition import cell_weights, check_one_piece, face_areas, merge_pieces


def part_graph(graph: csr_matrix, vertices: np.ndarray, parts: int) -> np.ndarray:
    """Return METIS's part of every vertex, (n,); a part may be in pieces or have no vertices.

    `graph`: cost of cutting two vertices apart, integers of at least 1, (n, n), symmetric; `vertices`: weight
    of each vertex, integers of at least 1, (n,).
    """
    flags = sys.getdlopenflags()
    # dolfinx 0.5 loads the METIS of the system for all libraries, whose indices have 32 bits; pymetis must
    # call its own.
    sys.setdlopenflags(os.RTLD_NOW | os.RTLD_LOCAL | getattr(os, "RTLD_DEEPBIND", 0))
    try:
        import pymetis
    finally:
        sys.setdlopenflags(flags)
    answer = pymetis.part_graph(
        parts,
        pymetis.CSRAdjacency(graph.indptr, graph.indices),
        eweights=graph.data,
        vweights=vertices,
        recursive=True,
        options=pymetis.Options(seed=1),
    )
    return np.asarray(answer.vertex_part, dtype=np.int64)


STEPS = 1000
"""Integer value of the largest weight, as METIS uses integers."""


def graph_partition(mesh: BodyMesh, parts: int, body: str = "") -> np.ndarray:
    """Cut any mesh with small interfaces between its subdomains.

    The same mesh gives the same subdomains on every call and every rank.

    Args:
        mesh: Any mesh that is connected through faces.
        parts: Number of subdomains.
        body: Name of the body, for messages.

    Returns:
        (n_cells,) subdomain numbers, every subdomain connected through faces.

    Raises:
        InvalidInputError: If the mesh consists of separate parts.
    """
    check_one_piece(mesh, body)
    if parts == 1:
        return np.zeros(mesh.n_cells, dtype=np.int64)
    pairs, areas = face_areas(mesh)
    graph = dual_graph(mesh.n_cells, pairs, areas)
    partition = part_graph(graph, _integers(cell_weights(mesh)), parts)
    partition = smoothed(_without_empty_parts(graph, partition, parts), pairs, areas)
    return merge_pieces(mesh, partition, body)


def dual_graph(n_cells: int, pairs: np.ndarray, areas: np.ndarray) -> csr_matrix:
    """Return the areas, in integers, of the faces between the cells, (n_cells, n_cells)."""
    rows, columns = np.concatenate([pairs, pairs[:, ::-1]]).T
    graph = coo_matrix((np.tile(_integers(areas), 2), (rows, columns)), shape=2 * (n_cells,)).tocsr()
    graph.sort_indices()
    return graph


def _integers(weights: np.ndarray) -> np.ndarray:
    """Return weights as integers from 1 to `STEPS`."""
    return np.asarray(np.maximum(1, np.round(STEPS * weights / weights.max())), dtype=np.int64)


def _without_empty_parts(graph: csr_matrix, partition: np.ndarray, parts: int) -> np.ndarray:
    """Give half of the largest part to every part without cells."""
    partition = partition.copy()
    sizes = np.bincount(partition, minlength=parts)
    for empty in np.flatnonzero(sizes == 0):
        largest = int(np.argmax(sizes))
        cells = np.flatnonzero(partition == largest)
        inside = graph[cells][:, cells]
        reached = breadth_first_order(inside, 0, directed=False, return_predecessors=False)
        # Cells not reached from the first one are another piece and move first.
        order = np.concatenate([np.setdiff1d(np.arange(cells.size), reached), reached[::-1]])
        moved = cells[order[: cells.size // 2]]
        partition[moved] = empty
        sizes[empty], sizes[largest] = moved.size, cells.size - moved.size
    return partition


ROUNDS = 20
"""Largest number of passes; each reduces the boundaries, and a few suffice."""

GAIN = 1e-9
"""A cell moves if the boundaries shrink by more than this fraction of the largest face."""


def smoothed(partition: np.ndarray, pairs: np.ndarray, areas: np.ndarray) -> np.ndarray:
    """Move cells that share more area with another subdomain than with their own.

    In each pass only cells move that gain more than all their neighbours, so that no two moves interfere. A
    cell that shares no face with its own subdomain stays: no subdomain loses its last one.

    `partition`: (n_cells,) subdomain numbers; `pairs`: pairs of cells that share a face, (n, 2); `areas`:
    areas of these faces, (n,).

    Returns (n_cells,) subdomain numbers.
    """
    cell, other = np.concatenate([pairs, pairs[:, ::-1]]).T
    area, parts = np.tile(areas, 2), int(partition.max()) + 1
    for _ in range(ROUNDS):
        gain, better = _gains(partition, cell * parts + partition[other], area)
        wishes = gain > GAIN * areas.max()
        place = np.empty(len(partition), dtype=np.int64)
        place[np.argsort(np.where(wishes, gain, 0.0), kind="stable")] = np.arange(len(partition))
        highest = np.zeros_like(place)
        np.maximum.at(highest, cell, np.where(wishes[other], place[other], 0))
        moves = wishes & (place > highest)
        if not moves.any():
            break
        partition = np.where(moves, better, partition)
    return partition


def _gains(partition: np.ndarray, towards: np.ndarray, area: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Return the largest gain of each cell by a move, zero if it stays, and the target subdomain.

    `partition`: (n_cells,) subdomain numbers; `towards`: cell and subdomain beyond every face, from both
    sides, as one number, (2 n,); `area`: areas of the faces, (2 n,).
    """
    parts = int(partition.max()) + 1
    unique, where = np.unique(towards, return_inverse=True)
    shared = np.bincount(where.ravel(), area)
    cells, subdomains = unique // parts, unique % parts
    own = np.zeros(len(partition))
    inside = subdomains == partition[cells]
    own[cells[inside]] = shared[inside]
    order = np.argsort(np.where(inside, 0.0, shared), kind="stable")  # the last assignment wins
    gain, better = np.zeros(len(partition)), partition.copy()
    gain[cells[order]] = np.where(inside, 0.0, shared - own[cells])[order]
    better[cells[order]] = subdomains[order]
    return np.where(own > 0.0, gain, 0.0), better
