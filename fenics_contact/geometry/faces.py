"""Faces of hexahedral and tetrahedral cells: numbering, neighbours, boundary, outward orientation.

A face is written as its node numbers in cyclic order, such that the right-hand rule gives the normal
that points out of the cell. Two faces are the same when they have the same nodes.
"""

from __future__ import annotations

import numpy as np

from fenics_contact.errors import InvalidInputError

HEXAHEDRON_FACES = np.array(
    [[0, 3, 2, 1], [4, 5, 6, 7], [0, 1, 5, 4], [2, 3, 7, 6], [0, 4, 7, 3], [1, 2, 6, 5]], dtype=np.int64
)
"""Local faces of a hexahedron (VTK order of vertices), outward: lower and upper in z, then y, then x."""

TETRAHEDRON_FACES = np.array([[0, 2, 1], [0, 1, 3], [1, 2, 3], [0, 3, 2]], dtype=np.int64)
"""Local faces of a tetrahedron, outward."""


def cell_faces(cells: np.ndarray) -> np.ndarray:
    """List the faces of every cell, outward.

    Args:
        cells: Node numbers, (n_cells, 8) for hexahedra or (n_cells, 4) for tetrahedra.

    Returns:
        Node numbers of the faces, (n_cells, 6, 4) or (n_cells, 4, 3).
    """
    return cells[:, HEXAHEDRON_FACES if cells.shape[1] == 8 else TETRAHEDRON_FACES]


def face_keys(faces: np.ndarray) -> np.ndarray:
    """Reduce faces to two integers each that do not depend on the order of the nodes.

    Args:
        faces: Node numbers, (n, 4) or (n, 3), all below 2**31.

    Returns:
        (n, 2) int64; equal rows belong to faces with equal nodes.
    """
    nodes = np.sort(faces, axis=1).astype(np.int64)
    low = (nodes[:, 0] << 31) + nodes[:, 1]
    high = nodes[:, 2] if nodes.shape[1] == 3 else (nodes[:, 2] << 31) + nodes[:, 3]
    return np.column_stack([low, high])


def number_faces(faces: np.ndarray) -> np.ndarray:
    """Number faces so that those with the same nodes get the same number.

    Args:
        faces: Node numbers, (n, 4) or (n, 3).

    Returns:
        (n,) int64 numbers from 0 without holes.
    """
    if faces.shape[0] == 0:
        return np.zeros(0, dtype=np.int64)
    keys = face_keys(faces)
    order = np.lexsort((keys[:, 1], keys[:, 0]))
    changes = np.any(np.diff(keys[order], axis=0) != 0, axis=1)
    numbers = np.empty(faces.shape[0], dtype=np.int64)
    numbers[order] = np.concatenate([[0], np.cumsum(changes)])
    return numbers


def boundary_faces(cells: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Extract the faces that belong to one cell only.

    Args:
        cells: Node numbers, (n_cells, 8 | 4).

    Returns:
        The faces, outward, (n, 4 | 3), and the cell that each belongs to, (n,), ascending.
    """
    faces = cell_faces(cells)
    flat = faces.reshape(-1, faces.shape[2])
    numbers = number_faces(flat)
    single = np.flatnonzero(np.bincount(numbers)[numbers] == 1)
    return flat[single], single // faces.shape[1]


def neighbours(cells: np.ndarray) -> np.ndarray:
    """Find the pairs of cells that share a face.

    Args:
        cells: Node numbers, (n_cells, 8 | 4).

    Returns:
        (n_pairs, 2) cell numbers.

    Raises:
        InvalidInputError: If more than two cells share a face.
    """
    faces = cell_faces(cells)
    flat = faces.reshape(-1, faces.shape[2])
    numbers = number_faces(flat)
    counts = np.bincount(numbers)
    if counts.max() > 2:
        worst = flat[np.argmax(numbers == np.argmax(counts))]
        raise InvalidInputError(
            f"a face must belong to at most 2 cells, the face with nodes {worst.tolist()} belongs to "
            f"{counts.max()}: remove duplicated or overlapping cells"
        )
    order = np.argsort(numbers, kind="stable")
    order = order[counts[numbers[order]] == 2]
    return (order // faces.shape[1]).reshape(-1, 2)


def match_faces(faces: np.ndarray, candidates: np.ndarray) -> np.ndarray:
    """Find each face among the candidates, whatever its orientation.

    Args:
        faces: Node numbers, (n, k).
        candidates: Node numbers, (m, k), all different faces.

    Returns:
        (n,) positions in ``candidates``, -1 where there is none.
    """
    numbers = number_faces(np.concatenate([candidates, faces]))
    position = np.full(numbers.max(initial=-1) + 1, -1, dtype=np.int64)
    position[numbers[: candidates.shape[0]]] = np.arange(candidates.shape[0])
    return position[numbers[candidates.shape[0] :]]


def orient(cells: np.ndarray, facets: np.ndarray) -> np.ndarray:
    """Write boundary facets as the cells have them: cyclic and outward.

    Args:
        cells: Node numbers, (n_cells, 8 | 4).
        facets: Node numbers in any order, (n, 4 | 3).

    Returns:
        The same facets, outward, (n, 4 | 3).

    Raises:
        InvalidInputError: If a facet is not on the boundary.
    """
    boundary, _ = boundary_faces(cells)
    found = match_faces(facets, boundary)
    if np.any(found < 0):
        lost = np.flatnonzero(found < 0)
        raise InvalidInputError(
            f"facets must be boundary faces of the cells, {lost.size} of {facets.shape[0]} are not, first "
            f"facet {lost[0]} with nodes {facets[lost[0]].tolist()}: take them from `boundary_faces(cells)`"
        )
    return boundary[found]


def start_at_smallest(facets: np.ndarray) -> np.ndarray:
    """Rotate every facet so that it starts at its smallest node; equal cycles become equal rows.

    Args:
        facets: Node numbers in cyclic order, (n, k).

    Returns:
        The rotated facets, (n, k).
    """
    k = facets.shape[1]
    columns = (np.argmin(facets, axis=1)[:, None] + np.arange(k)) % k
    return np.take_along_axis(facets, columns, axis=1)


def vector_areas(points: np.ndarray, facets: np.ndarray) -> np.ndarray:
    """Integrate the outward normal over every facet.

    The vector area of a bilinear facet is half the cross product of its diagonals, exactly. Over a closed
    surface the vector areas add up to zero.

    Args:
        points: Coordinates, (n_nodes, 3).
        facets: Node numbers in cyclic order, (n, 4 | 3).

    Returns:
        (n, 3) vectors: normal times area (for a warped facet: of its projection along the mean normal).
    """
    corners = points[facets]
    if facets.shape[1] == 3:
        first, second = corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0]
    else:
        first, second = corners[:, 2] - corners[:, 0], corners[:, 3] - corners[:, 1]
    return np.asarray(0.5 * np.cross(first, second))
