"""Cell types: dimension, shape, degree, order of nodes, facets.

Forms of bodies of revolution are written on cells whose type has the word axisymmetric in front: they have
weights and strains of their own. Where such bodies may twist, the word torsion follows: displacements have a
third component, around the axis. The word reduced behind the type stands for integrals by fewer points.
"""

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


#: What the types of cells of bodies of revolution begin with.
_REVOLVED = "axisymmetric "
#: What follows where such bodies may twist.
_TWISTING = "torsion "
#: What the types of quadratic cells end with that are integrated by the points of linear ones.
_REDUCED = " reduced"
_RESISTING = " resisting"


def revolved(cell_type: str, torsion: bool = False) -> str:
    """Return the type of plane cells as that of a body of revolution, which may twist."""
    return _REVOLVED + (_TWISTING if torsion else "") + cell_type


def reduced(cell_type: str, resisting: bool = False) -> str:
    """Return the type of quadratic cells as that of cells integrated by the points of linear ones.

    `resisting`: whether none of their motions goes without energy.
    """
    return cell_type + (_RESISTING if resisting else "") + _REDUCED


def is_reduced(cell_type: str) -> bool:
    """Return whether quadratic cells are integrated by the points of linear ones."""
    return cell_type.endswith(_REDUCED)


def is_resisting(cell_type: str) -> bool:
    """Return whether motions without energy of reduced cells are given some."""
    return _RESISTING in cell_type


def is_revolved(cell_type: str) -> bool:
    """Return whether cells are those of a body of revolution."""
    return cell_type.startswith(_REVOLVED)


def has_torsion(cell_type: str) -> bool:
    """Return whether cells are those of a body of revolution that may twist."""
    return cell_type.startswith(_REVOLVED + _TWISTING)


def components(cell_type: str) -> int:
    """Return the number of components of displacements on such cells."""
    return 3 if has_torsion(cell_type) else dimension(cell_type)


def of_mesh(cell_type: str) -> str:
    """Return the type that the cells have in a mesh, which does not know what a body makes of them."""
    return (
        cell_type.removeprefix(_REVOLVED)
        .removeprefix(_TWISTING)
        .removesuffix(_REDUCED)
        .removesuffix(_RESISTING)
    )


def shape(cell_type: str) -> str:
    """Return dolfinx's name of the shape of such cells."""
    cell = of_mesh(cell_type)
    return _SHAPE.get(cell, cell)


def degree(cell_type: str) -> int:
    """Return the degree of the map from the reference cell and of displacements, 1 or 2."""
    return 2 if of_mesh(cell_type) in _SHAPE else 1


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
