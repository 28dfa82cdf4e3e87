"""A box of structured hexahedra or tetrahedra."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from numpy.typing import ArrayLike

from fenics_contact.checks import LARGEST, STEEPEST, brief, check_count, check_row
from fenics_contact.errors import InvalidInputError
from fenics_contact.gallery.memory import require_room
from fenics_contact.gallery.structured import check_cell_type, split_hexahedra, structured_cells
from fenics_contact.mesh import BodyMesh, boundary_faces, vector_areas
from fenics_contact.surface_shapes import tensor_grid

SIDES = ("x0", "x1", "y0", "y1", "z0", "z1")


def block(
    lower: Sequence[float],
    upper: Sequence[float],
    counts: tuple[int, int, int],
    cell: str = "hexahedron",
    *,
    grading: Sequence[float] = (0.0, 0.0, 0.0),
) -> BodyMesh:
    """Mesh the box between two corners.

    Args:
        lower: Lower corner, (3,), [length].
        upper: Upper corner, (3,), [length].
        counts: Number of hexahedra along x, y and z.
        cell: ``"hexahedron"``, or ``"tetrahedron"`` to split each of them into six.
        grading: Logarithm of the ratio of the largest to the smallest cell along each axis; positive: small
            cells at the lower corner, negative: at the upper one, 0: equal cells.

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
    check_cell_type(cell)
    return box_lattice(checked_ticks(lower, upper, counts, grading, "xyz"), cell)


def checked_corners(lower: ArrayLike, upper: ArrayLike, axes: str) -> tuple[np.ndarray, np.ndarray]:
    """Return the corners of a box along the axes, (dim,) each, if they span one.

    Raises:
        InvalidInputError: If they do not.
    """
    try:
        low, high = np.asarray(lower, dtype=np.float64), np.asarray(upper, dtype=np.float64)
    except (TypeError, ValueError, OverflowError):
        low = high = np.zeros(0)
    fitting = low.shape == high.shape == (len(axes),)
    small = fitting and max(np.abs(low).max(), np.abs(high).max()) < LARGEST
    if not small or not np.all(high > low):
        given = [list(corner) if isinstance(corner, Sequence) else corner for corner in (lower, upper)]
        raise InvalidInputError(
            f"upper must exceed lower in {_listed(axes)}, got lower {brief(given[0])} and upper "
            f"{brief(given[1])}: swap or correct the corners"
        )
    return low, high


def checked_counts(counts: Sequence[int], axes: str) -> list[int]:
    """Return the numbers of cells along every axis, if the mesh fits into memory.

    Raises:
        InvalidInputError: If one is not a count, or they are too large.
    """
    known = np.ndim(counts) == 1 or isinstance(counts, str)
    if not known or len(counts) != len(axes):
        number = "three" if len(axes) == 3 else "two"
        raise InvalidInputError(
            f"counts must be {number} integers, got {brief(counts)}: give one for each of {_listed(axes)}"
        )
    for direction, count in enumerate(counts):
        check_count(count, f"counts[{direction}]")
    require_room(*counts)
    return [int(count) for count in counts]


def _listed(axes: str) -> str:
    return f"{', '.join(axes[:-1])} and {axes[-1]}"


def checked_ticks(
    lower: ArrayLike, upper: ArrayLike, counts: Sequence[int], grading: Sequence[float], axes: str
) -> list[np.ndarray]:
    """Return the coordinates of the ends of cells along every axis; arguments as for `block`.

    Raises:
        InvalidInputError: If there is no box, a count is invalid, or cells would be too many or too
            different.
    """
    low, high = checked_corners(lower, upper, axes)
    whole = checked_counts(counts, axes)
    check_row(grading, "grading", len(axes))
    if max(map(abs, grading)) > STEEPEST:
        raise InvalidInputError(
            f"grading must lie between {-STEEPEST:g} and {STEEPEST:g}, got {brief(grading)}: 0 gives equal "
            "cells, 3 makes the smallest 20 times smaller than the largest"
        )
    return [_ticks(*each) for each in zip(low, high, whole, grading, strict=True)]


def _ticks(low: float, high: float, count: int, grading: float) -> np.ndarray:
    """Divide an interval into cells that grow or, with negative grading, shrink."""
    if grading == 0.0:
        return np.linspace(low, high, count + 1)
    share = graded(count, abs(grading))
    return low + (high - low) * share if grading > 0 else high - (high - low) * share[::-1]


def graded(n: int, grading: float) -> np.ndarray:
    """Divide [0, 1] into intervals that grow geometrically; those for 2 n halve those for n.

    Args:
        n: Number of intervals.
        grading: Logarithm of the growth over the whole of [0, 1], 0 for equal intervals.

    Returns:
        Ascending ticks, (n + 1,).
    """
    uniform = np.linspace(0.0, 1.0, n + 1)
    return uniform if grading == 0.0 else np.asarray(np.expm1(grading * uniform) / np.expm1(grading))


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
    require_room(*(len(tick) - 1 for tick in ticks))
    points = tensor_grid(ticks)
    n1, n2, n3 = (len(t) - 1 for t in ticks)
    cells, grid = structured_cells((n1, n2, n3))
    mesh = BodyMesh(points, cells, box_sides(points, cells), grid)
    return mesh if cell == "hexahedron" else split_hexahedra(mesh)


def box_sides(points: np.ndarray, cells: np.ndarray) -> dict[str, np.ndarray]:
    """Sort the boundary faces of a box or rectangle by their direction.

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
