"""A rectangle of structured quadrilaterals or triangles."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from fenics_contact.errors import InvalidInputError
from fenics_contact.gallery.block import box_sides, checked_ticks
from fenics_contact.gallery.memory import require_room
from fenics_contact.gallery.structured import check_cell_type, repeated_regions, structured_cells
from fenics_contact.mesh import CELL_TYPES, BodyMesh
from fenics_contact.surface_shapes import tensor_grid


def rectangle(
    lower: Sequence[float],
    upper: Sequence[float],
    counts: tuple[int, int],
    cell: str = "quadrilateral",
    *,
    grading: Sequence[float] = (0.0, 0.0),
) -> BodyMesh:
    """Mesh the rectangle between two corners.

    Args:
        lower: Lower left corner, (2,), [length].
        upper: Upper right corner, (2,), [length].
        counts: Number of quadrilaterals along x and y.
        cell: ``"quadrilateral"``, or ``"triangle"`` to split each of them into two.
        grading: Logarithm of the ratio of the largest to the smallest cell along each axis; positive: small
            cells at the lower corner, negative: at the upper one, 0: equal cells.

    Returns:
        The mesh with surfaces ``x0, x1, y0, y1`` (lower and upper edge in each direction); the grid index is
        the position along x and y.

    Raises:
        InvalidInputError: If the rectangle has no area, a count is not positive or the cell type is unknown.
    """
    check_cell_type(cell, 2)
    return rectangle_lattice(checked_ticks(lower, upper, counts, grading, "xy"), cell)


def rectangle_lattice(ticks: Sequence[np.ndarray], cell: str = "quadrilateral") -> BodyMesh:
    """Mesh a rectangle whose cells end at given coordinates, for graded meshes.

    Args:
        ticks: Ascending coordinates of the mesh lines along x and y, each (n + 1,).
        cell: As in `rectangle`.

    Returns:
        As `rectangle`.
    """
    check_cell_type(cell, 2)
    require_room(*(len(tick) - 1 for tick in ticks))
    points = tensor_grid(ticks)
    cells, grid = structured_cells((len(ticks[0]) - 1, len(ticks[1]) - 1))
    mesh = BodyMesh(points, cells, box_sides(points, cells), grid)
    return mesh if cell == "quadrilateral" else split_quadrilaterals(mesh)


def split_quadrilaterals(mesh: BodyMesh, mirrored: np.ndarray | None = None) -> BodyMesh:
    """Split every quadrilateral into two triangles along a diagonal.

    Args:
        mesh: Quadrilaterals.
        mirrored: (n_cells,) bool: whether the diagonal runs from vertex 1 to vertex 3 and not from vertex 0
            to vertex 2; nowhere unless given.

    Returns:
        The triangles on the same nodes, surfaces unchanged, grid index repeated, regions split alike.

    Raises:
        InvalidInputError: If the cells are not quadrilaterals, or one is not convex at that diagonal.
    """
    if mesh.cell_type != "quadrilateral":
        raise InvalidInputError(
            f"split_quadrilaterals needs quadrilaterals, got cells of type {mesh.cell_type}: give it a mesh "
            "of quadrilaterals (`split_hexahedra` splits those of three dimensions)"
        )
    cells = mesh.cells
    if mirrored is not None:
        cells = np.where(mirrored[:, None], np.roll(cells, -1, axis=1), cells)
    triangles = cells[:, CELL_TYPES["quadrilateral"].simplices].reshape(-1, 3)
    grid = None if mesh.grid is None else np.repeat(mesh.grid, 2, axis=0)
    regions = repeated_regions(mesh, 2)
    return BodyMesh(mesh.points, triangles, mesh.surfaces, grid, regions, mesh.coincident_nodes, mesh.shapes)
