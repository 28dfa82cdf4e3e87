"""Structured hexahedra and quadrilaterals, possibly closed into a ring, and their split into simplices."""

from __future__ import annotations

import numpy as np

from fenics_contact.checks import brief
from fenics_contact.errors import InvalidInputError
from fenics_contact.mesh import CELL_TYPES, BodyMesh, boundary_faces, match_faces, orient
from fenics_contact.surface_shapes import tensor_grid

KUHN_TETRAHEDRA = CELL_TYPES["hexahedron"].simplices
"""Six tetrahedra around the diagonal from vertex 0 to vertex 6 of a hexahedron."""

REFLECTIONS = np.array(
    [[1, 0, 3, 2, 5, 4, 7, 6], [3, 2, 1, 0, 7, 6, 5, 4], [4, 5, 6, 7, 0, 1, 2, 3]], dtype=np.int64
)
"""Vertices of a hexahedron after mirroring it in its first, second or third direction."""


def check_cell_type(cell: str, dim: int = 3) -> None:
    """Reject a cell type that the structured meshes do not support."""
    known = tuple(name for name, kind in CELL_TYPES.items() if kind.dim == dim)
    if not isinstance(cell, str) or cell not in known:
        raise InvalidInputError(f"cell must be one of {known}, got {brief(cell)}: choose one of them")


def structured_cells(counts: tuple[int, ...], closed: bool = False) -> tuple[np.ndarray, np.ndarray]:
    """Number the hexahedra or quadrilaterals of a lattice.

    Node (i, j, k) has the number ``(i * (n2 + 1) + j) * (n3 + 1) + k``; cells follow the same order.

    Args:
        counts: Number of cells in each direction, three or two.
        closed: If true, the first direction is a ring: its last layer of cells ends at its first nodes.

    Returns:
        Cells, (n_cells, 8 | 4), and their indices, (n_cells, 3 | 2), int64.
    """
    solid = len(counts) == 3
    n1, n2, n3 = counts if solid else (*counts, 1)
    nodes = np.arange((n1 + (not closed)) * (n2 + 1) * (n3 + solid)).reshape(-1, n2 + 1, n3 + solid)
    low, high = (nodes, np.roll(nodes, -1, axis=0)) if closed else (nodes[:-1], nodes[1:])
    vertices = [
        layer[:, j : n2 + j, k : n3 + k]
        for k in range(1 + solid)
        for layer, j in ((low, 0), (high, 0), (high, 1), (low, 1))
    ]
    cells = np.stack(vertices, axis=-1).reshape(-1, len(vertices))
    grid = tensor_grid(map(np.arange, counts))
    return cells.astype(np.int64), grid.astype(np.int64)


def repeated_regions(mesh: BodyMesh, pieces: int) -> dict[str, np.ndarray]:
    """Return the regions after every cell c was split into cells ``pieces * c + (0 ... pieces - 1)``."""
    return {
        name: (pieces * cells[:, None] + np.arange(pieces)).ravel() for name, cells in mesh.regions.items()
    }


def split_hexahedra(mesh: BodyMesh, mirrored: np.ndarray | None = None) -> BodyMesh:
    """Split every hexahedron into six tetrahedra around a space diagonal.

    The diagonal runs from vertex 0 to vertex 6, or between their mirror images. Neighbours meet in the same
    face diagonals where their vertices are numbered alike, as in every structured mesh of this package, and
    whole layers of cells are mirrored.

    Args:
        mesh: Hexahedra with the vertex order of `structured_cells`.
        mirrored: (n_cells, 3) bool: whether the diagonal is mirrored in each local direction; nowhere unless
            given.

    Returns:
        The tetrahedra on the same nodes, surfaces and regions split alike, grid index repeated.

    Raises:
        InvalidInputError: If the cells are not hexahedra, or the diagonals of neighbours do not meet.
    """
    if mesh.cell_type != "hexahedron":
        raise InvalidInputError(
            f"split_hexahedra needs hexahedra, got cells of type {mesh.cell_type}: give it a mesh of "
            "hexahedra (`split_quadrilaterals` splits those of two dimensions)"
        )
    cells = _split_cells(mesh.cells, mirrored)
    grid = None if mesh.grid is None else np.repeat(mesh.grid, KUHN_TETRAHEDRA.shape[0], axis=0)
    boundary, _ = boundary_faces(cells)
    if boundary.shape[0] != 2 * boundary_faces(mesh.cells)[0].shape[0]:
        raise InvalidInputError(
            "hexahedra must be numbered alike to be split, some neighbours' diagonals do not meet: build "
            "them with `structured_cells`, or mesh with tetrahedra from the start"
        )
    surfaces = {
        name: orient(cells, _split_facets(facets, boundary)) for name, facets in mesh.surfaces.items()
    }
    regions = repeated_regions(mesh, KUHN_TETRAHEDRA.shape[0])
    return BodyMesh(mesh.points, cells, surfaces, grid, regions, mesh.coincident_nodes, mesh.shapes)


def _split_cells(cells: np.ndarray, mirrored: np.ndarray | None) -> np.ndarray:
    """Six tetrahedra for each hexahedron, (6 n_cells, 4), all with positive Jacobian."""
    flip = np.zeros((cells.shape[0], 3), dtype=bool) if mirrored is None else mirrored
    for d, reflection in enumerate(REFLECTIONS):
        cells = np.where(flip[:, d : d + 1], cells[:, reflection], cells)
    tetrahedra = cells[:, KUHN_TETRAHEDRA]
    odd = (flip.sum(axis=1) % 2 == 1)[:, None, None]
    return np.where(odd, tetrahedra[:, :, [0, 1, 3, 2]], tetrahedra).reshape(-1, 4)


def _split_facets(facets: np.ndarray, boundary: np.ndarray) -> np.ndarray:
    """Cut quadrilaterals along the diagonal of the tetrahedra's boundary."""
    first = match_faces(facets[:, [0, 1, 2]], boundary) >= 0
    turned = np.where(first[:, None], facets, np.roll(facets, -1, axis=1))
    return turned[:, CELL_TYPES["quadrilateral"].simplices].reshape(-1, 3)
