"""Faces of cells: numbering, neighbours, boundary, outward orientation.

A face is written as its node numbers in cyclic order, such that the right-hand rule gives the normal
that points out of the cell. In two dimensions faces are edges, listed such that the cell lies to the left of
them. Faces of quadratic cells list their corners first, then the midpoints of the edges that follow the
corners, then the centre. Two faces are the same when they have the same corners.

In bodies of several shapes of cells a triangle is a face of four corners of which the last two are one node,
see `collapsed`; the other columns repeat nodes as well.

Cells of four nodes are tetrahedra unless ``dim=2``.
"""

from __future__ import annotations

import numpy as np
from scipy.sparse import coo_matrix
from scipy.sparse.csgraph import connected_components
from scipy.spatial import cKDTree

from fenics_contact._base.checks import check_each
from fenics_contact.errors import InvalidInputError
from fenics_contact.mesh.cell_types import FACET_TYPES, cell_type_of
from fenics_contact.mesh.collapsed import has_collapsed
from fenics_contact.mesh.hanging import NO_HANGING, HangingNodes

LAST_BITS = 8.0
"""A rotated and shifted coordinate is off by a few units in the last place; a difference by twice as many."""

OPERATIONS = 8.0
"""Number of roundings of coordinates that a few operations on them add up to."""

LARGEST_NODE = 2**31 - 1
"""No node has this number: two of them are one integer."""

NOTHING = 1e-10
"""Lengths below this fraction of a body's size, plus the rounding of its coordinates, count as zero."""


def coordinate_rounding(points: np.ndarray) -> float:
    """Return the largest distance of nodes that are meant to coincide, [length]."""
    return float(LAST_BITS * np.finfo(np.float64).eps * np.abs(points).max(initial=0.0))


def computed_rounding(points: np.ndarray) -> float:
    """Return how far off a length may be that a few operations make of coordinates, [length]."""
    return OPERATIONS * coordinate_rounding(points)


def coincident_pairs(points: np.ndarray, tolerance: float = NOTHING) -> np.ndarray:
    """Return the pairs of nodes that coincide, each pair and the list ascending."""
    reach = tolerance * float(np.linalg.norm(np.ptp(points, axis=0))) + coordinate_rounding(points)
    pairs = cKDTree(points).query_pairs(reach, output_type="ndarray")
    return np.asarray(pairs[np.lexsort((pairs[:, 1], pairs[:, 0]))], dtype=np.int64)


def check_no_coincident_nodes(points: np.ndarray) -> None:
    """Reject a mesh with coincident nodes."""
    pairs = coincident_pairs(points)
    if pairs.shape[0] == 0:
        return
    first, second = pairs[0]
    place = ", ".join(f"{x:.6g}" for x in points[first])
    raise InvalidInputError(
        f"every node must have a place of its own, {np.unique(pairs).size} of {len(points)} nodes coincide "
        f"with another, first nodes {first} and {second} at ({place}): join them with "
        "`merge_duplicate_nodes`, or pass coincident_nodes=True where they are the two sides of a crack"
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
    check_each(
        (np.diff(vertices, axis=1) != 0).all(axis=1),
        "cells must keep their vertices when nodes are joined",
        f"lower the tolerance of {tolerance:g}, or remove these degenerate cells",
        "cell {}".format,
    )
    return points[first[order]], new[cells], new


def cell_faces(cells: np.ndarray, dim: int = 3) -> np.ndarray:
    """List the faces of every cell, outward, (n_cells, faces of a cell, nodes of a face)."""
    faces = cells[:, cell_type_of(cells, dim).faces]
    return triangles_last(faces.reshape(-1, faces.shape[2])).reshape(faces.shape)


def corners_of(faces: np.ndarray, dim: int) -> np.ndarray:
    """Return the corners of faces, linear or quadratic, in cyclic order, (n, 4 | 3 | 2)."""
    return faces[:, : len(FACET_TYPES[faces.shape[1], dim].edges)]


def face_keys(faces: np.ndarray) -> np.ndarray:
    """Reduce faces to two integers each that do not depend on the order of the nodes, all below 2**31."""
    nodes = np.zeros((faces.shape[0], 4), dtype=np.int64)
    corners = faces[:, : 3 if faces.shape[1] == 6 else 4]
    nodes[:, : corners.shape[1]] = np.sort(corners, axis=1)
    if corners.shape[1] == 4 and (twice := nodes[:, :-1] == nodes[:, 1:]).any():
        # A triangle has one key however it is written: its corners, ascending, and a zero.
        nodes[:, :-1][twice] = LARGEST_NODE
        nodes = np.sort(nodes, axis=1)
        nodes[nodes == LARGEST_NODE] = 0
    return (nodes[:, [0, 2]] << 31) + nodes[:, [1, 3]]


def number_faces(faces: np.ndarray) -> np.ndarray:
    """Number faces so that those with the same nodes have the same number."""
    return _numbered(face_keys(faces))


def _numbered(keys: np.ndarray) -> np.ndarray:
    """Return consecutive numbers of keys, (n, 2), in their order, the same for equal ones, (n,)."""
    if len(keys) == 0:
        return np.zeros(0, dtype=np.int64)
    order = _in_order(keys)
    changes = np.zeros(len(keys), dtype=bool)
    for column in keys.T:  # one after the other: keys are the largest arrays of a mesh
        ordered = column[order]
        changes[1:] |= ordered[1:] != ordered[:-1]
    numbers = np.empty(len(keys), dtype=np.int64)
    numbers[order] = np.cumsum(changes)
    return numbers


def _in_order(keys: np.ndarray, bits: int = 21) -> np.ndarray:
    """Return the lexical order of keys, (n,); of triangles with nodes below 2^bits by one integer each."""
    most = keys.max(axis=0)
    if most[0] >> 31 < 1 << bits and not np.any(keys[:, 1] & (1 << 31) - 1):
        least = keys[:, 0] & (1 << 31) - 1
        third = keys[:, 1] >> 31
        if max(least.max(), third.max()) < 1 << bits:
            return np.argsort(((keys[:, 0] >> 31) << 2 * bits) + (least << bits) + third, kind="stable")
    return np.lexsort((keys[:, 1], keys[:, 0]))


def _numbers_of_faces(cells: np.ndarray, dim: int) -> np.ndarray:
    """Return the numbers of the faces of all cells, as `number_faces`, cell by cell."""
    faces = cell_type_of(cells, dim).faces
    keys = np.empty((len(cells), len(faces), 2), dtype=np.int64)
    for place, nodes in enumerate(faces):
        keys[:, place] = face_keys(cells[:, nodes])
    keys = keys.reshape(-1, 2)
    flat = flat_faces(cells, dim)
    keys[flat] = -1 - flat[:, None]  # each is alone
    return _numbered(keys)


def flat_faces(cells: np.ndarray, dim: int) -> np.ndarray:
    """Return the places of faces that are no more than an edge or a vertex, of collapsed cells, (n,)."""
    if not has_collapsed(cells, dim):
        return np.zeros(0, dtype=np.int64)
    faces = cell_type_of(cells, dim).faces
    corners = np.sort(cells[:, faces[:, : 2 * (dim - 1)]], axis=2)
    different = 1 + np.count_nonzero(np.diff(corners, axis=2), axis=2)
    return np.flatnonzero(different.ravel() < dim)


def _faces_at(cells: np.ndarray, dim: int, places: np.ndarray) -> np.ndarray:
    """Return some faces of cells, by their places in the list of all, (n, nodes of a face)."""
    faces = cell_type_of(cells, dim).faces
    return triangles_last(cells[places[:, None] // len(faces), faces[places % len(faces)]])


#: Columns of faces of 4 and 9 nodes that begin with another corner, by that corner.
_TURNED = {
    4: np.array([[0, 1, 2, 3], [1, 2, 3, 0], [2, 3, 0, 1], [3, 0, 1, 2]]),
    9: np.array([[*(np.arange(4) + k) % 4, *4 + (np.arange(4) + k) % 4, 8] for k in range(4)]),
}


def triangles_last(faces: np.ndarray) -> np.ndarray:
    """Return faces of four corners so that of triangles the last two are one node; others as they are."""
    if faces.shape[1] not in _TURNED:
        return faces
    twice = faces[:, :4] == np.roll(faces[:, :4], -1, axis=1)
    if not (turned := twice[:, :3].any(axis=1)).any():
        return faces
    result = faces.copy()
    start = (twice[turned].argmax(axis=1) + 2) % 4
    result[turned] = np.take_along_axis(faces[turned], _TURNED[faces.shape[1]][start], axis=1)
    return result


def is_triangle(faces: np.ndarray) -> np.ndarray:
    """Return which faces of four corners are triangles, whose last two corners are one node, (n,)."""
    if faces.shape[1] not in _TURNED:
        return np.zeros(len(faces), dtype=bool)
    return np.asarray(faces[:, 2] == faces[:, 3])


TRIANGLE_COLUMNS = {4: [0, 1, 2], 9: [0, 1, 2, 4, 5, 7]}
"""Nodes of triangles that are written as faces of four corners, by the number of nodes of these."""
_WIDE = {(3, 4): [0, 1, 2, 2], (6, 9): [0, 1, 2, 2, 3, 4, 2, 5, 2]}


def widened(faces: np.ndarray, width: int) -> np.ndarray:
    """Return triangles as faces of four corners with so many nodes; others as they are."""
    columns = _WIDE.get((faces.shape[1], width))
    return triangles_last(faces) if columns is None else faces[:, columns]


def of_one_shape(faces: np.ndarray) -> list[tuple[np.ndarray, np.ndarray]]:
    """Return triangles and others among faces: numbers and nodes of each; all where they are alike."""
    mine = is_triangle(faces)
    if not mine.any():
        return [(np.arange(len(faces)), faces)]
    parts = (np.flatnonzero(mine), np.flatnonzero(~mine))
    return [(numbers, narrowed(faces[numbers])) for numbers in parts if len(numbers)]


def narrowed(faces: np.ndarray) -> np.ndarray:
    """Return faces that are all triangles with 3 or 6 nodes each; others as they are."""
    return faces[:, TRIANGLE_COLUMNS[faces.shape[1]]] if len(faces) and is_triangle(faces).all() else faces


def in_columns(values: np.ndarray, width: int) -> np.ndarray:
    """Return values at nodes of triangles as those at nodes of wider faces; others as they are.

    They are zero where these repeat a node.
    """
    if values.shape[1] == width:
        return values
    result = np.zeros((len(values), width))
    result[:, TRIANGLE_COLUMNS[width]] = values
    return result


def boundary_faces(
    cells: np.ndarray, dim: int = 3, hanging: HangingNodes = NO_HANGING
) -> tuple[np.ndarray, np.ndarray]:
    """Extract the faces that belong to only one cell.

    Args:
        cells: Node numbers, as in `cell_faces`.
        dim: Dimension of the space, 2 or 3.
        hanging: Hanging nodes of the mesh. The faces of small cells on those of larger ones lie inside then.

    Returns:
        The faces, outward, (n, nodes of a face), and the cell that each belongs to, (n,), ascending.
    """
    numbers = _numbers_of_faces(cells, dim)
    single = np.setdiff1d(np.flatnonzero(np.bincount(numbers)[numbers] == 1), flat_faces(cells, dim))
    if hanging:
        small, large = _on_larger(_faces_at(cells, dim, single), hanging)
        single = np.delete(single, np.concatenate([small, large]))
    return _faces_at(cells, dim, single), single // len(cell_type_of(cells, dim).faces)


def _on_larger(faces: np.ndarray, hanging: HangingNodes) -> tuple[np.ndarray, np.ndarray]:
    """Return which faces lie on larger ones, and on which, shape (n,) each.

    With its hanging nodes replaced by their masters, a face on a larger one has the nodes of that.
    """
    size = faces.shape[1]
    row_of = np.full(int(faces.max(initial=0)) + 1, -1)
    known = hanging.nodes[hanging.nodes < len(row_of)]
    row_of[known] = np.arange(len(known))
    candidates = np.flatnonzero((row_of[faces] >= 0).any(axis=1))
    row = row_of[faces[candidates]]
    spanned = np.where((row >= 0)[:, :, None], hanging.masters[row], faces[candidates][:, :, None])
    spanned = np.sort(spanned.reshape(len(candidates), -1), axis=1)
    first = np.column_stack([np.ones(len(candidates), dtype=bool), np.diff(spanned, axis=1) > 0])
    fits = np.count_nonzero(first, axis=1) == size
    larger = match_faces(spanned[fits][first[fits]].reshape(-1, size), faces)
    return candidates[fits][larger >= 0], larger[larger >= 0]


def shared_faces(
    cells: np.ndarray, dim: int = 3, hanging: HangingNodes = NO_HANGING
) -> tuple[np.ndarray, np.ndarray]:
    """Find the faces that two cells share; where cells have different sizes, those of the smaller ones.

    Returns the faces, outward of the first cell, and their two cells.
    """
    numbers, of_cell = _numbers_of_faces(cells, dim), len(cell_type_of(cells, dim).faces)
    counts = np.bincount(numbers)
    if counts.max() > 2:
        worst = _faces_at(cells, dim, np.flatnonzero(numbers == np.argmax(counts))[:1])[0]
        raise InvalidInputError(
            f"at most 2 cells may share a face, {counts.max()} share {worst.tolist()}: remove overlaps"
        )
    order = np.argsort(numbers, kind="stable")
    order = order[counts[numbers[order]] == 2]
    found, pairs = _faces_at(cells, dim, order[::2]), (order // of_cell).reshape(-1, 2)
    if hanging:
        single = np.flatnonzero(counts[numbers] == 1)
        chosen = _faces_at(cells, dim, single)
        small, large = _on_larger(chosen, hanging)
        found = np.concatenate([found, chosen[small]])
        pairs = np.concatenate([pairs, np.column_stack([single[small], single[large]]) // of_cell])
    return found, pairs


def neighbours(cells: np.ndarray, dim: int = 3, hanging: HangingNodes = NO_HANGING) -> np.ndarray:
    """Find the pairs of cells that share a face, (n, 2); arguments and errors as in `shared_faces`."""
    return shared_faces(cells, dim, hanging)[1]


def match_faces(faces: np.ndarray, candidates: np.ndarray) -> np.ndarray:
    """Find each face among different candidates, whatever its orientation; −1 where there is none."""
    numbers = _numbered(np.concatenate([face_keys(candidates), face_keys(faces)]))
    position = np.full(numbers.max(initial=-1) + 1, -1, dtype=np.int64)
    position[numbers[: candidates.shape[0]]] = np.arange(candidates.shape[0])
    return position[numbers[candidates.shape[0] :]]


def orient(
    cells: np.ndarray, facets: np.ndarray, dim: int = 3, hanging: HangingNodes = NO_HANGING
) -> np.ndarray:
    """Return boundary facets, whose corners are in any order, in the cells' order: cyclic and outward.

    Args:
        cells: Node numbers, as in `cell_faces`.
        facets: Nodes of each facet, corners alone or all of them, shape (n, nodes of a facet).
        dim: Dimension of the space, 2 or 3.
        hanging: Hanging nodes of the mesh.

    Returns:
        The facets as a surface of `BodyMesh` has them, with all their nodes, shape (n, nodes of a face).

    Raises:
        InvalidInputError: If one is no boundary face of the cells.

    Example:
        >>> orient(np.array([[0, 1, 2, 3]]), np.array([[1, 0], [2, 3]]), dim=2).tolist()
        [[0, 1], [2, 3]]
    """
    boundary, _ = boundary_faces(cells, dim, hanging)
    matches = match_faces(corners_of(facets, dim), corners_of(boundary, dim))
    check_on_boundary(matches, "facets", facets, dim)
    return boundary[matches]


def check_on_boundary(matches: np.ndarray, name: str, facets: np.ndarray, dim: int) -> None:
    """Reject facets without a match among the boundary faces."""
    check_each(
        matches >= 0,
        f"{name} must consist of boundary faces of the cells",
        f"take them from `boundary_faces(cells, dim={dim})`",
        lambda k: f"facet {k} with nodes {facets[k].tolist()}",
    )


def start_at_smallest(facets: np.ndarray) -> np.ndarray:
    """Rotate every facet so that it starts at its smallest node, so that equal cycles become equal rows.

    Edges stay as they are: both directions would be one cycle, but differ in the side the normal points to.
    """
    k = facets.shape[1]
    if k == 2:
        return facets
    columns = (np.argmin(facets, axis=1)[:, None] + np.arange(k)) % k
    return np.take_along_axis(facets, columns, axis=1)


def vector_areas(points: np.ndarray, facets: np.ndarray) -> np.ndarray:
    """Integrate the outward normal over every facet.

    The vector area of a bilinear facet is half the cross product of its diagonals, exactly. In two dimensions
    it is the chord rotated clockwise by a right angle, also for curved edges. Quadratic facets in space are
    treated as four linear ones. Over a closed surface the vector areas add up to zero.
    """
    pieces = FACET_TYPES[facets.shape[1], points.shape[1]].pieces
    if points.shape[1] == 3 and len(pieces) > 1:
        return np.asarray(sum(vector_areas(points, facets[:, piece]) for piece in pieces))
    corners = points[facets]
    if points.shape[1] == 2:
        along = corners[:, 1] - corners[:, 0]
        return np.column_stack([along[:, 1], -along[:, 0]])
    if facets.shape[1] == 3:
        first, second = corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0]
    else:
        first, second = corners[:, 2] - corners[:, 0], corners[:, 3] - corners[:, 1]
    return np.asarray(0.5 * np.cross(first, second))
