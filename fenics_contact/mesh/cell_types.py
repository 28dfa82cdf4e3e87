"""Cell types with their nodes, faces and edges. Nodes are in the order of VTK."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cache
from typing import Any

import numpy as np

from fenics_contact._base.display import displayed
from fenics_contact.errors import InvalidInputError


@displayed
@dataclass(frozen=True, eq=False)
class CellType:
    """One type of cells.

    Attributes:
        name: Its name; that of linear cells is dolfinx's.
        plural: Plural for messages.
        dim: Dimension of the cell, and of the space it lies in unless it is a facet.
        nodes: Reference coordinates of the nodes, vertices first, (n_nodes, dim).
        faces: Local nodes of the faces, outward: in 3D the right-hand normal points out of the cell, in 2D,
            where a face is an edge, the cell lies to the left of it; (n_faces, nodes of a face), corners in
            cyclic order first, then the midpoints of the edges that follow them, then the centre.
        edges: Far ends of the edges at every vertex, right-handed, (n_vertices, dim).
        reference_volume: Volume (area) of the reference cell.
        pieces: Local nodes of the linear cells of the same shape that make up the cell, (n_pieces,
            n_vertices).
    """

    name: str
    plural: str
    dim: int
    nodes: np.ndarray
    faces: np.ndarray
    edges: np.ndarray
    reference_volume: float
    pieces: np.ndarray

    @property
    def vertices(self) -> np.ndarray:
        """Reference coordinates of the vertices, (n_vertices, dim)."""
        return self.nodes[: len(self.edges)]

    @property
    def face_pieces(self) -> np.ndarray:
        """Positions in a row of ``faces`` of the linear facets that make up a face, (n, corners)."""
        return FACET_TYPES[self.faces.shape[1], self.dim].pieces

    @property
    def shape_name(self) -> str:
        """Name of the linear cells of the same shape."""
        return self.name.rstrip("0123456789")

    @property
    def order(self) -> int:
        """Degree of the shape functions, 1 or 2."""
        return 1 if len(self.nodes) == len(self.edges) else 2

    @property
    def is_simplex(self) -> bool:
        """Whether it is a triangle or a tetrahedron."""
        return self.dim > 1 and len(self.edges) == self.dim + 1

    @property
    def simplices(self) -> np.ndarray:
        """Local vertices of the simplices that make up a linear cell, around its diagonal from vertex 0."""
        return np.arange(self.dim + 1)[None] if self.is_simplex else _AROUND_DIAGONAL[self.dim]

    @property
    def is_affine(self) -> bool:
        """Whether the map from the reference cell is affine."""
        return self.order == 1 and self.is_simplex


def _table(rows: list[list[int]]) -> np.ndarray:
    return np.array(rows, dtype=np.int64)


def _linear(
    name: str,
    plural: str,
    vertices: list[list[float]],
    faces: list[list[int]],
    edges: list[list[int]],
    volume: float,
) -> CellType:
    nodes = np.array(vertices)
    whole = np.arange(len(nodes))[None]
    return CellType(name, plural, nodes.shape[1], nodes, _table(faces), _table(edges), volume, whole)


def _quadratic(
    linear: CellType, name: str, plural: str, extra: list[list[float]], pieces: list[list[int]]
) -> CellType:
    """Return the quadratic cells of a shape; the nodes of their faces are identified by position."""
    nodes = np.concatenate([linear.nodes, np.array(extra)])
    number = {tuple(place): index for index, place in enumerate(nodes)}
    faces = []
    for face in linear.faces:
        corners = linear.nodes[face]
        middles = 0.5 * (corners + np.roll(corners, -1, axis=0))
        more = [*middles[:1]] if len(face) == 2 else [*middles, corners.mean(axis=0)]
        more = more[:3] if len(face) == 3 else more  # triangles have no centre
        faces.append([*face, *(number[tuple(place)] for place in more)])
    return CellType(
        name,
        plural,
        linear.dim,
        nodes,
        _table(faces),
        linear.edges,
        linear.reference_volume,
        _table(pieces),
    )


_SQUARE = [[0.0, 0.0], [1.0, 0.0], [1.0, 1.0], [0.0, 1.0]]
_HALF = [[0.5, 0.0], [1.0, 0.5], [0.5, 1.0], [0.0, 0.5]]
_QUARTERS = [[0, 4, 8, 7], [4, 1, 5, 8], [8, 5, 2, 6], [7, 8, 6, 3]]

_AROUND_DIAGONAL = {
    2: _table([[0, 1, 2], [0, 2, 3]]),
    3: _table([[0, 1, 2, 6], [0, 3, 7, 6], [0, 4, 5, 6], [0, 5, 1, 6], [0, 2, 3, 6], [0, 7, 4, 6]]),
}

EDGE = _linear("edge", "edges", [[0.0], [1.0]], [[0], [1]], [[1], [0]], 1.0)
"""A facet of plane cells, not a cell."""
TRIANGLE = _linear(
    "triangle",
    "triangles",
    [[0.0, 0.0], [1.0, 0.0], [0.0, 1.0]],
    [[0, 1], [1, 2], [2, 0]],
    [[1, 2], [2, 0], [0, 1]],
    1.0 / 2.0,
)
QUADRILATERAL = _linear(
    "quadrilateral",
    "quadrilaterals",
    _SQUARE,
    [[0, 1], [1, 2], [2, 3], [3, 0]],
    [[1, 3], [2, 0], [3, 1], [0, 2]],
    1.0,
)
TETRAHEDRON = _linear(
    "tetrahedron",
    "tetrahedra",
    [[0.0, 0.0, 0.0], [1.0, 0.0, 0.0], [0.0, 1.0, 0.0], [0.0, 0.0, 1.0]],
    [[0, 2, 1], [0, 1, 3], [1, 2, 3], [0, 3, 2]],
    [[1, 2, 3], [2, 0, 3], [0, 1, 3], [0, 2, 1]],
    1.0 / 6.0,
)
HEXAHEDRON = _linear(
    "hexahedron",
    "hexahedra",
    [[*corner, z] for z in (0.0, 1.0) for corner in _SQUARE],
    [[0, 3, 2, 1], [4, 5, 6, 7], [0, 1, 5, 4], [2, 3, 7, 6], [0, 4, 7, 3], [1, 2, 6, 5]],
    [[1, 3, 4], [2, 0, 5], [3, 1, 6], [0, 2, 7], [7, 5, 0], [4, 6, 1], [5, 7, 2], [6, 4, 3]],
    1.0,
)
EDGE3 = CellType(
    "edge3",
    "quadratic edges",
    1,
    np.array([[0.0], [1.0], [0.5]]),
    EDGE.faces,
    EDGE.edges,
    1.0,
    _table([[0, 2], [2, 1]]),
)
"""A facet of quadratic plane cells."""
TRIANGLE6 = _quadratic(
    TRIANGLE,
    "triangle6",
    "quadratic triangles",
    [[0.5, 0.0], [0.5, 0.5], [0.0, 0.5]],
    [[0, 3, 5], [3, 1, 4], [5, 4, 2], [3, 4, 5]],
)
TETRAHEDRON10 = _quadratic(
    TETRAHEDRON,
    "tetrahedron10",
    "quadratic tetrahedra",
    [[0.5, 0, 0], [0.5, 0.5, 0], [0, 0.5, 0], [0, 0, 0.5], [0.5, 0, 0.5], [0, 0.5, 0.5]],
    # Four at the corners, and the octahedron between them, which is cut along one diagonal.
    [
        *([0, 4, 6, 7], [4, 1, 5, 8], [6, 5, 2, 9], [7, 8, 9, 3]),
        *([6, 8, 4, 5], [6, 8, 5, 9], [6, 8, 9, 7], [6, 8, 7, 4]),
    ],
)
QUADRILATERAL9 = _quadratic(
    QUADRILATERAL,
    "quadrilateral9",
    "quadratic quadrilaterals",
    [*_HALF, [0.5, 0.5]],
    _QUARTERS,
)
HEXAHEDRON27 = _quadratic(
    HEXAHEDRON,
    "hexahedron27",
    "quadratic hexahedra",
    [
        *([*place, 0.0] for place in _HALF),
        *([*place, 1.0] for place in _HALF),
        *([*corner, 0.5] for corner in _SQUARE),
        *(
            [
                [0.0, 0.5, 0.5],
                [1.0, 0.5, 0.5],
                [0.5, 0.0, 0.5],
                [0.5, 1.0, 0.5],
                [0.5, 0.5, 0.0],
                [0.5, 0.5, 1.0],
            ]
        ),
        [0.5, 0.5, 0.5],
    ],
    [
        [0, 8, 24, 11, 16, 22, 26, 20],
        [8, 1, 9, 24, 22, 17, 21, 26],
        [24, 9, 2, 10, 26, 21, 18, 23],
        [11, 24, 10, 3, 20, 26, 23, 19],
        [16, 22, 26, 20, 4, 12, 25, 15],
        [22, 17, 21, 26, 12, 5, 13, 25],
        [26, 21, 18, 23, 25, 13, 6, 14],
        [20, 26, 23, 19, 15, 25, 14, 7],
    ],
)

FACET_TYPES = {
    (2, 2): EDGE, (3, 2): EDGE3,
    (3, 3): TRIANGLE, (4, 3): QUADRILATERAL, (6, 3): TRIANGLE6, (9, 3): QUADRILATERAL9,
}  # fmt: skip
"""(nodes of a facet, dimension of space) to its type."""
CELL_TYPES = {
    cell.name: cell
    for cell in (
        *(TRIANGLE, QUADRILATERAL, TETRAHEDRON, HEXAHEDRON),
        *(TRIANGLE6, QUADRILATERAL9, TETRAHEDRON10, HEXAHEDRON27),
    )
}
"""Name to type, for all types."""


OF_THE_FILE = (
    "such cells are not read: write the mesh with linear or quadratic ones (gmsh: Mesh.ElementOrder = 1 or 2)"
)
"""Remedy for cells of higher order."""


def cell_type_of(cells: np.ndarray, dim: int) -> CellType:
    """Return the type of cells; for four nodes it depends on the dimension."""
    for cell in CELL_TYPES.values():
        if cell.dim == dim and cells.ndim == 2 and cells.shape[1] == cell.nodes.shape[0]:
            return cell
    if dim == 3 and cells.ndim == 2 and cells.shape[1] == 20:
        raise InvalidInputError(
            "hexahedra of 20 nodes are those of 27 whose centres follow: add these by in_vtk_order(points, "
            "cells) and take serendipity(BodyMesh(points, cells))"
        )
    known = " or ".join(
        f"(n_cells, {cell.nodes.shape[0]}) for {cell.plural}"
        for cell in CELL_TYPES.values()
        if cell.dim == dim
    )
    if not known:
        raise InvalidInputError(f"dim must be 2 or 3, got {dim}: give the number of coordinates of a node")
    raise InvalidInputError(
        f"cells in {dim} dimensions must have shape {known}, got {cells.shape}: dim=2 is for a plane mesh"
    )


#: basix's names of the shapes of simplices and of other cells, by their dimension from 1 on.
_SIMPLICES = ("interval", "triangle", "tetrahedron")
_OTHERS = ("interval", "quadrilateral", "hexahedron")


def shape_values(cell: CellType, positions: np.ndarray) -> np.ndarray:
    """Evaluate the shape functions at reference coordinates, (m, nodes of a cell)."""
    return _tabulated(cell, positions, 0)[0]


def shape_gradients(cell: CellType, positions: np.ndarray) -> np.ndarray:
    """Evaluate the gradients of the shape functions in reference coordinates, (m, nodes, dim)."""
    return np.moveaxis(_tabulated(cell, positions, 1)[1:], 0, 2)


@cache
def quadrature(cell: CellType, degree: int | None = None) -> tuple[np.ndarray, np.ndarray]:
    """Return a rule that integrates squares of shape functions, and the Jacobian of curved cells, exactly.

    Two Gauss points per direction on linear and three on quadratic edges, quadrilaterals and hexahedra; rules
    of degree two on linear and of degree five on quadratic simplices. Its weights add up to the reference
    volume.
    """
    import basix

    own = 2 if cell.is_simplex and cell.order == 1 else 2 * cell.order + 1
    positions, weights = basix.make_quadrature(_shape(cell), degree or own)
    return np.asarray(positions), np.asarray(weights)


def _tabulated(cell: CellType, positions: np.ndarray, derivatives: int) -> np.ndarray:
    """Return the shape functions and their derivatives in each direction, (1 + ..., m, nodes of a cell)."""
    element, number = _element(cell)
    if len(positions) == 0:  # of which some versions of basix end the process
        return np.zeros((1 + derivatives * cell.dim, 0, len(number)))
    values = element.tabulate(derivatives, np.ascontiguousarray(positions, dtype=np.float64))
    return np.asarray(values[..., number, 0])


@cache
def _element(cell: CellType) -> tuple[Any, np.ndarray]:
    """Return basix's element and the number of its function for each node of the cell."""
    import basix

    equispaced = basix.LagrangeVariant.equispaced
    element = basix.create_element(basix.ElementFamily.P, _shape(cell), cell.order, equispaced)
    distance = np.abs(cell.nodes[:, None] - element.points).sum(axis=2)
    return element, distance.argmin(axis=1)


def _shape(cell: CellType) -> Any:
    import basix  # takes a tenth of a second

    return getattr(basix.CellType, (_SIMPLICES if cell.is_simplex else _OTHERS)[cell.dim - 1])
