"""A box of structured hexahedra or tetrahedra: the plainest body there is."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from fenics_contact.errors import InvalidInputError
from fenics_contact.geometry.faces import boundary_faces, vector_areas
from fenics_contact.geometry.mesh import BodyMesh
from fenics_contact.geometry.structured import check_cell_type, check_count, split_hexahedra, structured_cells

SIDES = ("x0", "x1", "y0", "y1", "z0", "z1")


def block(
    lower: Sequence[float],
    upper: Sequence[float],
    counts: tuple[int, int, int],
    cell: str = "hexahedron",
) -> BodyMesh:
    """Mesh the box between two corners.

    Args:
        lower: Coordinates of the lower corner, (3,).
        upper: Coordinates of the upper corner, (3,).
        counts: Number of hexahedra along x, y and z.
        cell: ``"hexahedron"``, or ``"tetrahedron"`` to split each of them into six.

    Returns:
        The mesh with surfaces ``x0, x1, y0, y1, z0, z1`` (lower and upper face in each direction); the
        grid index is the position along x, y, z.

    Raises:
        InvalidInputError: If the box has no volume, a count is not positive or the cell type is unknown.

    Example:
        >>> mesh = block((0, 0, 0), (2, 1, 1), (4, 2, 2))
        >>> mesh.n_cells, sorted(mesh.surfaces)
        (16, ['x0', 'x1', 'y0', 'y1', 'z0', 'z1'])
    """
    low, high = np.asarray(lower, dtype=np.float64), np.asarray(upper, dtype=np.float64)
    if low.shape != (3,) or high.shape != (3,) or not np.all(high > low):
        raise InvalidInputError(
            f"upper must exceed lower in x, y and z, got lower {list(lower)} and upper {list(upper)}: swap "
            "or correct the corners"
        )
    return box_lattice([np.linspace(low[d], high[d], _count(counts, d) + 1) for d in range(3)], cell)


def box_lattice(ticks: Sequence[np.ndarray], cell: str = "hexahedron") -> BodyMesh:
    """Mesh a box whose cells end at given coordinates, for graded meshes.

    Args:
        ticks: Ascending coordinates of the mesh planes along x, y and z, each (n + 1,).
        cell: As in `block`.

    Returns:
        As `block`.

    Raises:
        InvalidInputError: If coordinates do not ascend or the cell type is unknown.
    """
    check_cell_type(cell)
    points = np.stack(np.meshgrid(*ticks, indexing="ij"), axis=-1).reshape(-1, 3)
    n1, n2, n3 = (len(t) - 1 for t in ticks)
    cells, grid = structured_cells((n1, n2, n3))
    mesh = BodyMesh(points, cells, box_sides(points, cells), grid)
    return mesh if cell == "hexahedron" else split_hexahedra(mesh)


def box_sides(points: np.ndarray, cells: np.ndarray) -> dict[str, np.ndarray]:
    """Sort the boundary faces of a box or rectangle by the direction they face.

    Args:
        points: Coordinates, (n_nodes, 3 | 2).
        cells: Node numbers, (n_cells, n_vertices), of a box along the axes.

    Returns:
        Facets of each of the six `SIDES`, or of the first four.
    """
    dim = points.shape[1]
    facets, _ = boundary_faces(cells, dim)
    areas = vector_areas(points, facets)
    direction = np.argmax(np.abs(areas), axis=1)
    upper = np.take_along_axis(areas, direction[:, None], axis=1)[:, 0] > 0
    side = 2 * direction + upper
    return {name: facets[side == s] for s, name in enumerate(SIDES[: 2 * dim])}


def _count(counts: Sequence[int], direction: int) -> int:
    if len(counts) != 3:
        raise InvalidInputError(
            f"counts must be three integers, got {counts!r}: give one for each of x, y, z"
        )
    check_count(counts[direction], f"counts[{direction}]")
    return int(counts[direction])
