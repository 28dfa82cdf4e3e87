"""Partition of any mesh by METIS: small interfaces between subdomains of similar size.

The graph is the dual one: a vertex for every cell, an edge for every face that two cells share, weighted by
its area; see `partition.weights`. METIS may return a disconnected part and, when parts are small, a part
without cells; both are repaired. It balances parts to the cell, which leaves jagged boundaries; these are
smoothed.

References:
    G. Karypis, V. Kumar: A fast and high quality multilevel scheme for partitioning irregular graphs. SIAM J.
    Sci. Comput. 20 (1998).
"""

from __future__ import annotations

import numpy as np
from scipy.sparse import coo_matrix, csr_matrix
from scipy.sparse.csgraph import breadth_first_order

from fenics_contact.mesh import BodyMesh
from fenics_contact.partition.cutting import check_one_piece, check_parts, merge_pieces
from fenics_contact.partition.metis import part_graph
from fenics_contact.partition.smoothing import smoothed
from fenics_contact.partition.weights import cell_weights, face_areas

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
        InvalidInputError: If there are fewer cells than parts, or the mesh consists of separate parts.
        MissingRequirementError: If pymetis is missing, too old or cannot be loaded.
    """
    check_parts(mesh, parts)
    check_one_piece(mesh, body)
    if parts == 1:
        return np.zeros(mesh.n_cells, dtype=np.int64)
    pairs, areas = face_areas(mesh)
    graph = _dual_graph(mesh.n_cells, pairs, areas)
    partition = part_graph(graph, _integers(cell_weights(mesh)), parts)
    partition = smoothed(_without_empty_parts(graph, partition, parts), pairs, areas)
    return merge_pieces(mesh, partition, body)


def _dual_graph(n_cells: int, pairs: np.ndarray, areas: np.ndarray) -> csr_matrix:
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
