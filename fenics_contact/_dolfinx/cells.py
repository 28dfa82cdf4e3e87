"""The four kinds of cells: dimension, order of vertices, facets."""

from __future__ import annotations

_DIMENSION = {"triangle": 2, "quadrilateral": 2, "tetrahedron": 3, "hexahedron": 3}
#: The cells that a body may consist of.
CELL_TYPES = tuple(_DIMENSION)

#: Vertex order of VTK -> tensor-product order of dolfinx; each permutation is its own inverse.
VERTEX_ORDER = {
    "triangle": [0, 1, 2],
    "quadrilateral": [0, 1, 3, 2],
    "tetrahedron": [0, 1, 2, 3],
    "hexahedron": [0, 1, 3, 2, 4, 5, 7, 6],
}
#: Vertices (tensor-product order) of the facets of the reference cell, in dolfinx's facet numbering.
FACET_VERTICES = {
    "triangle": [[1, 2], [0, 2], [0, 1]],
    "quadrilateral": [[0, 1], [0, 2], [1, 3], [2, 3]],
    "tetrahedron": [[1, 2, 3], [0, 2, 3], [0, 1, 3], [0, 1, 2]],
    "hexahedron": [[0, 1, 2, 3], [0, 1, 4, 5], [0, 2, 4, 6], [1, 3, 5, 7], [2, 3, 6, 7], [4, 5, 6, 7]],
}


def dimension(cell_type: str) -> int:
    """Return the dimension of the space in which cells of this type lie, 2 or 3."""
    return _DIMENSION[cell_type]
