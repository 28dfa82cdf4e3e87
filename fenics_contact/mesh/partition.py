"""Cutting a mesh into subdomains.

A partition is an int64 array with the subdomain 0..S-1 of every cell. A subdomain must be connected through
faces: pieces joined only by an edge or a node have zero-energy relative motions beyond the rigid body modes
that the solver knows.

Slender subdomains, however many cells thick, have soft modes that cost iterations, and so have subdomains
with jagged boundaries. Both have more area than compact ones of the same size.
"""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from scipy.sparse import coo_matrix, csr_matrix
from scipy.sparse.csgraph import connected_components

from fenics_contact._base.checks import check_count, naming_arguments
from fenics_contact.errors import InvalidInputError
from fenics_contact.mesh.body_mesh import BodyMesh
from fenics_contact.mesh.cuts import closed
from fenics_contact.mesh.faces import neighbours, shared_faces, vector_areas
from fenics_contact.mesh.quality import cell_volumes


@naming_arguments
def box_partition(mesh: BodyMesh, boxes: tuple[int, ...]) -> np.ndarray:
    """Cut a structured mesh into boxes of cells.

    If a count is not divisible, the boxes differ by at most one layer of cells. Subdomains are numbered with
    the last direction running fastest, so that consecutive numbers are mostly neighbours.

    Args:
        mesh: Mesh with a ``grid``.
        boxes: Number of boxes in each direction of the grid.

    Returns:
        (n_cells,) subdomain numbers.

    Raises:
        InvalidInputError: If the mesh is not structured or has fewer cells than boxes in some direction.
    """
    if mesh.grid is None:
        raise InvalidInputError(
            "box_partition needs a structured mesh, this one has grid None: use `bisection_partition`"
        )
    if not isinstance(boxes, Sequence | np.ndarray) or np.shape(boxes) != (mesh.dim,):
        number = {2: "two", 3: "three"}[mesh.dim]
        raise InvalidInputError(f"boxes must be {number} integers, one a direction, got {boxes!r}")
    counts = mesh.grid.max(axis=0) + 1
    for d in range(mesh.dim):
        check_count(boxes[d], f"boxes[{d}]")
        if boxes[d] > counts[d]:
            raise InvalidInputError(
                f"boxes[{d}] must be at most the {counts[d]} layers of cells, got {boxes[d]}"
            )
    position = mesh.grid * np.asarray(boxes) // counts
    return np.ravel_multi_index(tuple(position.T), boxes).astype(np.int64)


def check_parts(mesh: BodyMesh, parts: int) -> None:
    """Reject a number of subdomains into which a mesh cannot be cut."""
    check_count(parts, "parts")
    if parts > mesh.n_cells:
        raise InvalidInputError(f"parts must be at most the {mesh.n_cells} cells, got {parts}: take fewer")


def _face_pieces(mesh: BodyMesh, partition: np.ndarray, pairs: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Number the face-connected pieces: piece of every cell, (n_cells,), and subdomain of every piece."""
    inside = pairs[partition[pairs[:, 0]] == partition[pairs[:, 1]]]
    graph = coo_matrix((np.ones(inside.shape[0], dtype=bool), tuple(inside.T)), shape=2 * (mesh.n_cells,))
    n_pieces, piece = connected_components(graph, directed=False)
    owner = np.empty(n_pieces, dtype=np.int64)
    owner[piece] = partition
    return piece, owner


def merge_pieces(
    mesh: BodyMesh, partition: np.ndarray, body: str = "", pairs: np.ndarray | None = None
) -> np.ndarray:
    """Make every subdomain connected through faces.

    The largest piece of each subdomain stays; every other piece goes to the subdomain with whose largest
    piece it shares most faces, those that touch none in a later round.
    """
    partition = _checked_partition(mesh, partition).copy()
    pairs = neighbours(mesh.cells, mesh.dim, mesh.hanging) if pairs is None else pairs
    while True:
        piece, owner = _face_pieces(mesh, partition, pairs)
        by_size = np.lexsort((np.arange(owner.size), -np.bincount(piece)))
        done = np.zeros(owner.size, dtype=bool)
        done[by_size[np.unique(owner[by_size], return_index=True)[1]]] = True
        if done.all():
            return partition
        links = np.concatenate([piece[pairs], piece[pairs][:, ::-1]])
        links = links[~done[links[:, 0]] & done[links[:, 1]]]
        if links.shape[0] == 0:
            raise _in_pieces(body, f"{np.count_nonzero(~done)} pieces of it have no neighbour")
        shared, counts = np.unique(links, axis=0, return_counts=True)
        order = np.argsort(counts, kind="stable")  # the last assignment wins: the one with most faces
        target = owner.copy()
        target[shared[order, 0]] = owner[shared[order, 1]]
        partition = target[piece]


def siblings(mesh: BodyMesh) -> np.ndarray:
    """Return which cells must lie in one subdomain, by the number of each such set, shape (n_cells,).

    At a hanging node they are the parts of one cell, which together have all masters of the node: a subdomain
    with all of them needs no equation for the node.
    """
    hanging = mesh.hanging
    faces, pairs = shared_faces(mesh.cells, mesh.dim)
    row_of = np.full(mesh.n_nodes, -1)
    row_of[hanging.nodes] = np.arange(len(hanging.nodes))
    joined = np.zeros(len(pairs), dtype=bool)
    for column in range(faces.shape[1]):  # corners of a face
        row = row_of[faces[:, column]]
        here = np.flatnonzero(row >= 0)
        # Of an edge or a face that was halved, each part has one corner: different ones in different parts.
        mine = hanging.masters[row[here]]
        has = [(mesh.cells[side][:, :, None] == mine[:, None, :]).any(axis=1) for side in pairs[here].T]
        joined[here] |= (has[0] != has[1]).any(axis=1)
    links = pairs[joined]
    graph = coo_matrix((np.ones(len(links), dtype=bool), tuple(links.T)), shape=2 * (mesh.n_cells,))
    return np.asarray(connected_components(graph, directed=False)[1])


def kept_together(mesh: BodyMesh, partition: np.ndarray, body: str = "") -> np.ndarray:
    """Return a partition that splits no siblings at hanging nodes; the same one where it splits none.

    They go to the subdomain that has most of them. Subdomains that lose all their cells vanish.
    """
    if not mesh.hanging or np.shape(partition) != (mesh.n_cells,):
        return partition
    group = siblings(mesh)
    counts = csr_matrix((np.ones(mesh.n_cells), (group, partition)))
    if counts.nnz == counts.shape[0]:
        return partition
    whole = np.asarray(counts.argmax(axis=1)).ravel()[group]
    whole = np.unique(whole, return_inverse=True)[1].ravel()
    return merge_pieces(mesh, whole, body)


_APART = (
    "join nodes that coincide with `merge_duplicate_nodes`, or give each separate part a mesh and a body of "
    "its own"
)


def _named(body: str) -> str:
    return f"body '{body}'" if body else "a mesh"


def _in_pieces(body: str, found: str) -> InvalidInputError:
    return InvalidInputError(f"{_named(body)} must be connected through faces to be cut, {found}: {_APART}")


def check_one_piece(mesh: BodyMesh, body: str = "", pairs: np.ndarray | None = None) -> None:
    """Reject a mesh that is not connected through faces, other than where a section cuts it."""
    mesh, pairs = (closed(mesh), None) if mesh.cuts else (mesh, pairs)
    pairs = neighbours(mesh.cells, mesh.dim, mesh.hanging) if pairs is None else pairs
    piece, owner = _face_pieces(mesh, np.zeros(mesh.n_cells, dtype=np.int64), pairs)
    if owner.size > 1:
        sizes = np.sort(np.bincount(piece))[::-1]
        largest = f"the largest of {sizes[0]} and {sizes[1]} cells"
        raise _in_pieces(body, f"it consists of {owner.size} parts, {largest}")


def check_face_connected(mesh: BodyMesh, partition: np.ndarray, body: str = "") -> None:
    """Reject a partition with a subdomain that is empty or not connected through faces."""
    partition = _checked_partition(mesh, partition)
    _, owner = _face_pieces(mesh, partition, neighbours(mesh.cells, mesh.dim, mesh.hanging))
    pieces = np.bincount(owner)
    torn = np.flatnonzero(pieces > 1)
    if torn.size:
        of = f" of {_named(body)}" if body else ""
        raise InvalidInputError(
            f"every subdomain{of} must be connected through cell faces, {torn.size} of {pieces.size} are "
            f"not, first subdomain {torn[0]} in {pieces[torn[0]]} pieces: cut differently or use "
            "`merge_pieces`"
        )


def _checked_partition(mesh: BodyMesh, partition: np.ndarray) -> np.ndarray:
    array = np.asarray(partition)
    if array.shape != (mesh.n_cells,) or not np.issubdtype(array.dtype, np.integer):
        raise InvalidInputError(
            f"partition must be integers of shape ({mesh.n_cells},), got {array.dtype} of shape {array.shape}"
        )
    if array.min() < 0:
        raise InvalidInputError(f"subdomain numbers must start at 0, got {array.min()}: shift them")
    empty = np.flatnonzero(np.bincount(array) == 0)
    if empty.size:
        raise InvalidInputError(
            f"subdomains must be numbered without holes, {empty[0]} of {array.max() + 1} is empty: renumber"
        )
    return array.astype(np.int64)


def face_areas(mesh: BodyMesh) -> tuple[np.ndarray, np.ndarray]:
    """Return the pairs of cells that share a face, (n, 2), and its area (in the plane length), (n,)."""
    faces, pairs = shared_faces(mesh.cells, mesh.dim, mesh.hanging)
    return pairs, np.linalg.norm(vector_areas(mesh.points, faces), axis=1)


def cell_weights(mesh: BodyMesh, power: float = 0.5) -> np.ndarray:
    """Return the weight of every cell, (n_cells,), with sum 1: the root of its volume, or another power.

    A compromise between equal numbers of cells, hence equal cost, and equal volume, hence compactness.
    """
    root = cell_volumes(mesh.points, mesh.cells) ** power
    return np.asarray(root / root.sum())
