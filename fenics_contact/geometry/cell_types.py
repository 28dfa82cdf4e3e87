"""The four types of cells and what is known of each: vertices, faces, edges. Vertices come in VTK order."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from fenics_contact.errors import InvalidInputError


@dataclass(frozen=True, eq=False)
class CellType:
    """One type of linear cells.

    Attributes:
        name: The name that dolfinx gives it too.
        plural: How a message speaks of such cells.
        dim: Dimension of the cell and of the space it lies in, 2 or 3.
        vertices: Reference coordinates of the vertices, (n_vertices, dim).
        faces: Local nodes of the faces, outward: in 3D the right-hand normal points out of the cell, in 2D,
            where a face is an edge, the cell lies to the left of it; (n_faces, nodes of a face).
        edges: Other ends of the edges at every vertex, right-handed, (n_vertices, dim).
        reference_volume: Volume (area) of the reference cell.
    """

    name: str
    plural: str
    dim: int
    vertices: np.ndarray
    faces: np.ndarray
    edges: np.ndarray
    reference_volume: float

    @property
    def is_simplex(self) -> bool:
        """Whether the map from the reference cell is affine."""
        return self.vertices.shape[0] == self.dim + 1


def _table(rows: list[list[int]]) -> np.ndarray:
    return np.array(rows, dtype=np.int64)


_SQUARE = [[0.0, 0.0], [1.0, 0.0], [1.0, 1.0], [0.0, 1.0]]

TRIANGLE = CellType(
    name="triangle",
    plural="triangles",
    dim=2,
    vertices=np.array([[0.0, 0.0], [1.0, 0.0], [0.0, 1.0]]),
    faces=_table([[0, 1], [1, 2], [2, 0]]),
    edges=_table([[1, 2], [2, 0], [0, 1]]),
    reference_volume=1.0 / 2.0,
)
QUADRILATERAL = CellType(
    name="quadrilateral",
    plural="quadrilaterals",
    dim=2,
    vertices=np.array(_SQUARE),
    faces=_table([[0, 1], [1, 2], [2, 3], [3, 0]]),
    edges=_table([[1, 3], [2, 0], [3, 1], [0, 2]]),
    reference_volume=1.0,
)
TETRAHEDRON = CellType(
    name="tetrahedron",
    plural="tetrahedra",
    dim=3,
    vertices=np.array([[0.0, 0.0, 0.0], [1.0, 0.0, 0.0], [0.0, 1.0, 0.0], [0.0, 0.0, 1.0]]),
    faces=_table([[0, 2, 1], [0, 1, 3], [1, 2, 3], [0, 3, 2]]),
    edges=_table([[1, 2, 3], [2, 0, 3], [0, 1, 3], [0, 2, 1]]),
    reference_volume=1.0 / 6.0,
)
HEXAHEDRON = CellType(
    name="hexahedron",
    plural="hexahedra",
    dim=3,
    vertices=np.array([[*corner, z] for z in (0.0, 1.0) for corner in _SQUARE]),
    faces=_table([[0, 3, 2, 1], [4, 5, 6, 7], [0, 1, 5, 4], [2, 3, 7, 6], [0, 4, 7, 3], [1, 2, 6, 5]]),
    edges=_table([[1, 3, 4], [2, 0, 5], [3, 1, 6], [0, 2, 7], [7, 5, 0], [4, 6, 1], [5, 7, 2], [6, 4, 3]]),
    reference_volume=1.0,
)

CELL_TYPES = {cell.name: cell for cell in (TRIANGLE, QUADRILATERAL, TETRAHEDRON, HEXAHEDRON)}
"""Name to type, all there are."""


QUADRATIC = (
    "quadratic cells are not supported: the contact constraints are one for every node and need nodal forces "
    "that are positive under a uniform pressure, which those of quadratic facets are not; write the mesh "
    "with linear cells (gmsh: Mesh.ElementOrder = 1)"
)
"""Why, and what to do."""

_QUADRATIC_NODES = {2: (6, 9), 3: (10, 20, 27)}


def cell_type_of(cells: np.ndarray, dim: int) -> CellType:
    """Return the type of cells; those of four nodes need the dimension to be told apart.

    Args:
        cells: Node numbers, (n_cells, n_vertices).
        dim: Dimension of the space, 2 or 3.

    Raises:
        InvalidInputError: If there are no such cells in this dimension.
    """
    for cell in CELL_TYPES.values():
        if cell.dim == dim and cells.ndim == 2 and cells.shape[1] == cell.vertices.shape[0]:
            return cell
    if cells.ndim == 2 and cells.shape[1] in _QUADRATIC_NODES.get(dim, ()):
        raise InvalidInputError(f"cells of {cells.shape[1]} nodes in {dim} dimensions: {QUADRATIC}")
    known = " or ".join(
        f"(n_cells, {cell.vertices.shape[0]}) for {cell.plural}"
        for cell in CELL_TYPES.values()
        if cell.dim == dim
    )
    if not known:
        raise InvalidInputError(f"dim must be 2 or 3, got {dim}: give the number of coordinates of a node")
    raise InvalidInputError(
        f"cells in {dim} dimensions must have shape {known}, got {cells.shape}: give the vertices of every "
        "cell in VTK order, and dim=2 for a plane mesh"
    )
