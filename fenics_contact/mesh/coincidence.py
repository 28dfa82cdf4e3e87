"""Coincident nodes: if unintended, the body is silently disconnected there."""

from __future__ import annotations

import numpy as np
from scipy.sparse import coo_matrix
from scipy.sparse.csgraph import connected_components
from scipy.spatial import cKDTree

from fenics_contact.errors import InvalidInputError
from fenics_contact.mesh.rounding import NOTHING, coordinate_rounding


def coincident_pairs(points: np.ndarray, tolerance: float = NOTHING) -> np.ndarray:
    """Return the pairs of nodes that coincide.

    Args:
        points: Coordinates, (n_nodes, 3 | 2).
        tolerance: Distance over the diagonal of the bounding box up to which nodes coincide; far from the
            origin the rounding of their coordinates is added.

    Returns:
        (n_pairs, 2) node numbers, each pair and the list ascending.
    """
    reach = tolerance * float(np.linalg.norm(np.ptp(points, axis=0))) + coordinate_rounding(points)
    pairs = cKDTree(points).query_pairs(reach, output_type="ndarray")
    return np.asarray(pairs[np.lexsort((pairs[:, 1], pairs[:, 0]))], dtype=np.int64)


def check_no_coincident_nodes(points: np.ndarray) -> None:
    """Reject a mesh with coincident nodes.

    Args:
        points: Coordinates, (n_nodes, 3 | 2).

    Raises:
        InvalidInputError: States their number, the first pair and its position.
    """
    pairs = coincident_pairs(points)
    if pairs.shape[0] == 0:
        return
    first, second = pairs[0]
    place = ", ".join(f"{x:.6g}" for x in points[first])
    raise InvalidInputError(
        f"every node must have a place of its own, {np.unique(pairs).size} of {points.shape[0]} nodes "
        f"coincide with another, first nodes {first} and {second} at ({place}): the cells around them do not "
        "hang together; join them with `merge_duplicate_nodes(points, cells)`, or pass "
        "coincident_nodes=True where they are the two sides of a crack"
    )


def merge_duplicate_nodes(
    points: np.ndarray, cells: np.ndarray, tolerance: float = NOTHING
) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Merge coincident nodes, also through chains of others. The two sides of a crack are merged.

    Args:
        points: Coordinates, (n_nodes, 3 | 2).
        cells: Node numbers, (n_cells, n_vertices).
        tolerance: Distance over the diagonal of the bounding box up to which nodes coincide.

    Returns:
        The remaining points (of merged nodes the first one), (m, 3 | 2), in their old order; the cells with
        their numbers; and the new number of every old node, (n_nodes,), with which facets are renumbered:
        ``new[facets]``.

    Raises:
        InvalidInputError: If a cell would lose a vertex: the tolerance is larger than the cell.
    """
    pairs = coincident_pairs(points, tolerance)
    graph = coo_matrix((np.ones(len(pairs), dtype=bool), tuple(pairs.T)), shape=2 * (len(points),))
    _, cluster = connected_components(graph, directed=False)
    _, first, new = np.unique(cluster, return_index=True, return_inverse=True)
    order = np.argsort(first)  # clusters in the order of their first node
    position = np.empty_like(order)
    position[order] = np.arange(order.size)
    new = position[new.ravel()]
    vertices = np.sort(new[cells], axis=1)
    lost = np.flatnonzero((np.diff(vertices, axis=1) == 0).any(axis=1))
    if lost.size:
        raise InvalidInputError(
            f"cells must keep their vertices when nodes are joined, {lost.size} of {len(cells)} do not, "
            f"first cell {lost[0]}: lower the tolerance of {tolerance:g}, or remove these degenerate cells"
        )
    return points[first[order]], new[cells], new
