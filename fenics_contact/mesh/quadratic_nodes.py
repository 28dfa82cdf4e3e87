"""Quadratic cells of mesh files: their midpoints in the order of VTK, missing centres added.

Programs agree on the order of the corners, not on that of the other nodes, so these are identified by
position. Serendipity cells, 20 or 8 nodes, are completed by the centres of their faces and of the cell,
placed by their shape functions: the geometry is unchanged, the displacements become richer.
"""

from __future__ import annotations

import numpy as np

from fenics_contact.errors import InvalidInputError
from fenics_contact.mesh.cell_types import (
    HEXAHEDRON,
    HEXAHEDRON27,
    QUADRILATERAL,
    QUADRILATERAL9,
    TETRAHEDRON,
    TETRAHEDRON10,
    TRIANGLE,
    TRIANGLE6,
    CellType,
    shape_values,
)
from fenics_contact.mesh.faces import number_faces

QUADRATIC = {
    6: TRIANGLE6, 8: QUADRILATERAL9, 9: QUADRILATERAL9,
    10: TETRAHEDRON10, 20: HEXAHEDRON27, 27: HEXAHEDRON27,
}  # fmt: skip
"""Number of nodes of a quadratic cell in a file to the resulting type."""

_LINEAR = {
    TRIANGLE6.name: TRIANGLE, QUADRILATERAL9.name: QUADRILATERAL,
    TETRAHEDRON10.name: TETRAHEDRON, HEXAHEDRON27.name: HEXAHEDRON,
}  # fmt: skip
_ENOUGH = 1000
"""Number of cells from which the order of nodes is determined."""


def in_vtk_order(points: np.ndarray, cells: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Order the nodes of quadratic cells as VTK does, and add the centres that are missing.

    Args:
        points: Coordinates, (n_nodes, 3 | 2) [length].
        cells: Node numbers, corners first, (n_cells, 6 | 8 | 9 | 10 | 20 | 27).

    Returns:
        Coordinates, new nodes at the end, and cells, (n_cells, 6 | 9 | 10 | 27).
    """
    kind = QUADRATIC[cells.shape[1]]
    cells = _ordered(points, cells, kind)
    if cells.shape[1] == len(kind.nodes):
        return points, cells
    if kind is HEXAHEDRON27:
        points, cells = _with_face_centres(points, cells)
    corners, count = len(kind.edges), len(points)
    middles = points[cells[:, corners : 20 if kind is HEXAHEDRON27 else 8]].sum(axis=1)
    share = 0.25 if kind is HEXAHEDRON27 else 0.5
    centres = share * middles - 0.25 * points[cells[:, :corners]].sum(axis=1)
    numbers = np.arange(count, count + len(cells))
    return np.concatenate([points, centres]), np.column_stack([cells, numbers])


def check_node_order(points: np.ndarray, cells: np.ndarray) -> None:
    """Reject quadratic cells whose nodes are in another order than that of VTK.

    `points`: coordinates, (n_nodes, 3 | 2) [length]; `cells`: node numbers, corners first, (n_cells, 6 | 9 |
    10 | 27).
    """
    kind = QUADRATIC[cells.shape[1]]
    ordered = _ordered(points, cells, kind)
    if (ordered == cells).all():
        return
    corners = len(kind.edges)
    around = shape_values(_LINEAR[kind.name], kind.nodes[corners:]) > 0.1
    expected = ", ".join("-".join(map(str, np.flatnonzero(row))) for row in around)
    places = [int(np.flatnonzero(ordered[0] == node)[0]) for node in cells[0]]
    raise InvalidInputError(
        f"the nodes of {kind.plural} must be in the order of VTK, the {corners} corners and then those "
        f"between the corners {expected}, but by their coordinates they are in the order {places} of these: "
        "give points, cells = in_vtk_order(points, cells), or check the coordinates"
    )


def _ordered(points: np.ndarray, cells: np.ndarray, kind: CellType) -> np.ndarray:
    """Return the order in which the nodes of all cells are nearest to the positions that VTK expects."""
    from scipy.optimize import linear_sum_assignment  # needed by few runs only

    corners = len(kind.edges)
    sample = cells[:: max(1, len(cells) // _ENOUGH)]
    linear = shape_values(_LINEAR[kind.name], kind.nodes[corners : cells.shape[1]])
    expected = np.einsum("mv,nvd->nmd", linear, points[sample[:, :corners]])
    given = points[sample[:, corners:]]
    size = np.ptp(points[sample], axis=1).max(axis=1)
    apart = np.linalg.norm(expected[:, :, None] - given[:, None], axis=3) / size[:, None, None]
    _, order = linear_sum_assignment(np.square(apart).sum(axis=0))
    return np.asarray(cells[:, [*range(corners), *(corners + order)]])


def _with_face_centres(points: np.ndarray, cells: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Add the centre of every face once for the cells that share it."""
    columns = HEXAHEDRON27.faces
    flat = cells[:, columns[:, :8]].reshape(-1, 8)
    numbers = number_faces(flat[:, :4])
    _, first = np.unique(numbers, return_index=True)
    faces = flat[first]
    centres = 0.5 * points[faces[:, 4:]].sum(axis=1) - 0.25 * points[faces[:, :4]].sum(axis=1)
    result = np.concatenate([cells, np.empty((len(cells), 6), dtype=np.int64)], axis=1)
    result[:, columns[:, 8]] = numbers.reshape(-1, 6) + len(points)
    return np.concatenate([points, centres]), result
