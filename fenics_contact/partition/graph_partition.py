"""Partition of any mesh by METIS: few faces between subdomains of like size.

The graph is the dual one: a vertex for every cell, an edge for every face that two cells share. METIS may
return a part in pieces, and, when parts are small, a part without cells; both are mended.

References:
    G. Karypis, V. Kumar: A fast and high quality multilevel scheme for partitioning irregular graphs. SIAM J.
    Sci. Comput. 20 (1998).
"""

from __future__ import annotations

import numpy as np
from scipy.sparse import coo_matrix, csr_matrix
from scipy.sparse.csgraph import breadth_first_order

from fenics_contact.checks import check_count
from fenics_contact.errors import InvalidInputError
from fenics_contact.mesh import BodyMesh, neighbours
from fenics_contact.partition.cutting import check_one_piece, merge_pieces
from fenics_contact.partition.metis import part_graph


def graph_partition(mesh: BodyMesh, parts: int, body: str = "") -> np.ndarray:
    """Cut any mesh so that few faces lie between its subdomains.

    The same mesh gives the same subdomains on every call and every rank.

    Args:
        mesh: Any mesh that is connected through faces.
        parts: Number of subdomains.
        body: Name of the body, for messages.

    Returns:
        (n_cells,) subdomain numbers, every subdomain connected through faces.

    Raises:
        InvalidInputError: If there are fewer cells than parts, or the mesh consists of separate parts.
        MissingRequirementError: If pymetis is missing, too old or cannot be loaded.
    """
    check_count(parts, "parts")
    if parts > mesh.n_cells:
        raise InvalidInputError(
            f"parts must be at most the {mesh.n_cells} cells, got {parts}: take fewer parts"
        )
    check_one_piece(mesh, body)
    if parts == 1:
        return np.zeros(mesh.n_cells, dtype=np.int64)
    graph = _dual_graph(mesh)
    partition = part_graph(graph.indptr, graph.indices, parts)
    return merge_pieces(mesh, _without_empty_parts(graph, partition, parts), body)


def _dual_graph(mesh: BodyMesh) -> csr_matrix:
    """Return the adjacency of the cells through faces, (n_cells, n_cells)."""
    one, other = neighbours(mesh.cells, mesh.dim).T
    rows, columns = np.concatenate([one, other]), np.concatenate([other, one])
    graph = coo_matrix(
        (np.ones(rows.size, dtype=np.int8), (rows, columns)), shape=2 * (mesh.n_cells,)
    ).tocsr()
    graph.sort_indices()
    return graph


def _without_empty_parts(graph: csr_matrix, partition: np.ndarray, parts: int) -> np.ndarray:
    """Give every part without cells half of the largest one."""
    partition = partition.copy()
    sizes = np.bincount(partition, minlength=parts)
    for empty in np.flatnonzero(sizes == 0):
        largest = int(np.argmax(sizes))
        cells = np.flatnonzero(partition == largest)
        inside = graph[cells][:, cells]
        reached = breadth_first_order(inside, 0, directed=False, return_predecessors=False)
        # What is not reached from the first cell is another piece and moves over first.
        order = np.concatenate([np.setdiff1d(np.arange(cells.size), reached), reached[::-1]])
        moved = cells[order[: cells.size // 2]]
        partition[moved] = empty
        sizes[empty], sizes[largest] = moved.size, cells.size - moved.size
    return partition
