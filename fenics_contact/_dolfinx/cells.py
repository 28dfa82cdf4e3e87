"""Cell types: dimension, shape, degree, order of nodes, facets."""

from __future__ import annotations

import numpy as np

_DIMENSION = {"triangle": 2, "quadrilateral": 2, "tetrahedron": 3, "hexahedron": 3}
#: Quadratic cells and the linear ones of the same shape.
_SHAPE = {
    "triangle6": "triangle", "quadrilateral9": "quadrilateral",
    "tetrahedron10": "tetrahedron", "hexahedron27": "hexahedron",
}  # fmt: skip
#: The cell types of bodies.
CELL_TYPES = (*_DIMENSION, *_SHAPE)

#: Node order of VTK -> that of dolfinx (tensor-product order of the vertices); the permutations of linear
#: cells are their own inverses.
NODE_ORDER = {
    "triangle": [0, 1, 2],
    "quadrilateral": [0, 1, 3, 2],
    "tetrahedron": [0, 1, 2, 3],
    "hexahedron": [0, 1, 3, 2, 4, 5, 7, 6],
    "triangle6": [0, 1, 2, 4, 5, 3],
    "quadrilateral9": [0, 1, 3, 2, 4, 7, 5, 6, 8],
    "tetrahedron10": [0, 1, 2, 3, 9, 8, 5, 7, 6, 4],
    "hexahedron27": [
        *(0, 1, 3, 2, 4, 5, 7, 6),
        *(8, 11, 16, 9, 17, 10, 19, 18, 12, 15, 13, 14),
        *(24, 22, 20, 21, 23, 25, 26),
    ],
}  # fmt: skip
#: Vertices (tensor-product order) of the facets of the reference cell, in dolfinx's facet numbering.
_FACET_VERTICES = {
    "triangle": [[1, 2], [0, 2], [0, 1]],
    "quadrilateral": [[0, 1], [0, 2], [1, 3], [2, 3]],
    "tetrahedron": [[1, 2, 3], [0, 2, 3], [0, 1, 3], [0, 1, 2]],
    "hexahedron": [[0, 1, 2, 3], [0, 1, 4, 5], [0, 2, 4, 6], [1, 3, 5, 7], [2, 3, 6, 7], [4, 5, 6, 7]],
}


def shape(cell_type: str) -> str:
    """Return dolfinx's name of the shape of such cells."""
    return _SHAPE.get(cell_type, cell_type)


def degree(cell_type: str) -> int:
    """Return the degree of the map from the reference cell and of displacements, 1 or 2."""
    return 2 if cell_type in _SHAPE else 1


def cell_type_named(name: str, order: int) -> str:
    """Return the type of cells with dolfinx's name and degree; the name itself if bodies cannot have them."""
    higher = [cell for cell, linear in _SHAPE.items() if linear == name and order == 2]
    return higher[0] if higher else name


def facet_vertices(cell_type: str) -> list[list[int]]:
    """Return the vertices, in tensor-product order, of the facets of the reference cell."""
    return _FACET_VERTICES[shape(cell_type)]


def facet_corners(cell_type: str) -> np.ndarray:
    """Return the vertices, in the order of VTK, of the facets of a cell as dolfinx numbers these."""
    return np.array(NODE_ORDER[shape(cell_type)])[facet_vertices(cell_type)]


def dimension(cell_type: str) -> int:
    """Return the dimension of the space in which cells of this type lie, 2 or 3."""
    return _DIMENSION[shape(cell_type)]
