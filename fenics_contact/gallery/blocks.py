"""Blocks and rectangles of structured cells, swept solids, graded ticks."""

from __future__ import annotations

import math
import os
import resource
from collections.abc import Sequence
from pathlib import Path

import numpy as np
from numpy.typing import ArrayLike

from fenics_contact._base.checks import LARGEST, STEEPEST, brief, check_count, check_numbers, check_row
from fenics_contact.errors import InvalidInputError
from fenics_contact.mesh.body_mesh import BodyMesh
from fenics_contact.mesh.cell_types import CELL_TYPES
from fenics_contact.mesh.faces import boundary_faces, match_faces, orient, vector_areas
from fenics_contact.shapes.parametric import tensor_grid
from fenics_contact.shapes.simple import Extruded, SurfaceShape

#: Memory for building and checking a structured mesh, by its dimension, in bytes per cell.
BYTES_A_CELL = {2: 550, 3: 1200}
#: Files of the memory limits of Linux containers, of both versions.
_LIMITS = ("/sys/fs/cgroup/memory.max", "/sys/fs/cgroup/memory/memory.limit_in_bytes")


def require_room(*counts: int) -> None:
    """Reject a mesh that does not fit into the memory of this machine."""
    cells = math.prod(map(int, counts))
    needed, there = cells * BYTES_A_CELL[len(counts)], memory()
    if needed > there:
        raise InvalidInputError(
            f"a mesh must fit into the memory, {there / 1e9:.3g} GB, got {' x '.join(map(str, counts))} "
            f"cells, which take {_size(needed)} while they are built: take fewer"
        )


def require_cells(what: str, mesh: BodyMesh, kind: str, name: str) -> None:
    """Reject a mesh of cells of another type."""
    if mesh.cell_type != kind:
        raise InvalidInputError(f"{what} needs {name}, got cells of type {mesh.cell_type}: mesh with {name}")


def memory() -> int:
    """Return the memory that this process may use, in bytes: limited by machine, container or process."""
    limits = [os.sysconf("SC_PAGE_SIZE") * os.sysconf("SC_PHYS_PAGES")]
    own, _ = resource.getrlimit(resource.RLIMIT_AS)
    if own != resource.RLIM_INFINITY:
        limits.append(own)
    for place in _LIMITS:
        try:
            limits.append(int(Path(place).read_text()))
        except (OSError, ValueError):  # there is none, or it says "max"
            continue
    return min(limits)


def _size(needed: int) -> str:
    for unit in ("GB", "TB", "PB"):
        if needed < 1000 * 10**9:
            return f"{needed / 1e9:.3g} {unit}"
        needed //= 1000
    return "more than a thousand PB"


KUHN_TETRAHEDRA = CELL_TYPES["hexahedron"].simplices
"""Six tetrahedra around the diagonal from vertex 0 to vertex 6 of a hexahedron."""

REFLECTIONS = np.array(
    [[1, 0, 3, 2, 5, 4, 7, 6], [3, 2, 1, 0, 7, 6, 5, 4], [4, 5, 6, 7, 0, 1, 2, 3]], dtype=np.int64
)
"""Vertices of a hexahedron after mirroring it in its first, second or third direction."""


def check_cell_type(cell: str, dim: int = 3) -> None:
    """Reject a cell type that the structured meshes do not support."""
    known = ("hexahedron", "tetrahedron") if dim == 3 else ("quadrilateral", "triangle")
    if not isinstance(cell, str) or cell not in known:
        curved = ", fenics_contact.mesh.quadratic makes quadratic cells of them" if cell in CELL_TYPES else ""
        raise InvalidInputError(f"cell must be one of {known}, got {brief(cell)}: choose one of them{curved}")


def structured_cells(counts: tuple[int, ...], closed: bool = False) -> tuple[np.ndarray, np.ndarray]:
    """Number the hexahedra or quadrilaterals of a lattice, and return their indices along its axes.

    Node (i, j, k) has the number ``(i * (n2 + 1) + j) * (n3 + 1) + k``; cells follow the same order.
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
    """Split every hexahedron into six tetrahedra around a space diagonal, on the same nodes.

    The diagonal runs from vertex 0 to vertex 6, or between their mirror images. Neighbours meet in the same
    face diagonals where their vertices are numbered alike, as in every structured mesh of this package, and
    whole layers of cells are mirrored. `mirrored`: (n_cells, 3) bool: whether the diagonal is mirrored in
    each local direction; nowhere unless given.
    """
    require_cells("split_hexahedra", mesh, "hexahedron", "hexahedra")
    cells = _split_cells(mesh.cells, mirrored)
    grid = None if mesh.grid is None else np.repeat(mesh.grid, KUHN_TETRAHEDRA.shape[0], axis=0)
    boundary, _ = boundary_faces(cells)
    if boundary.shape[0] != 2 * boundary_faces(mesh.cells)[0].shape[0]:
        raise InvalidInputError(
            "neighbouring hexahedra must be split alike, their diagonals do not meet: use structured_cells"
        )
    surfaces = {
        name: orient(cells, _split_facets(facets, boundary)) for name, facets in mesh.surfaces.items()
    }
    regions = repeated_regions(mesh, KUHN_TETRAHEDRA.shape[0])
    return BodyMesh(
        mesh.points, cells, surfaces, grid, regions, mesh.coincident_nodes, mesh.shapes
    ).with_chart(mesh.chart)


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


SIDES = ("x0", "x1", "y0", "y1", "z0", "z1")


def block(
    lower: Sequence[float],
    upper: Sequence[float],
    counts: tuple[int, int, int],
    cell: str = "hexahedron",
    *,
    grading: Sequence[float] = (0.0, 0.0, 0.0),
) -> BodyMesh:
    """Mesh the box between two corners, with surfaces x0, x1, y0, y1, z0 and z1.

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
    """Return the corners of a box along the axes, (dim,) each, if they span one."""
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
    """Return the numbers of cells along every axis, if the mesh fits into memory."""
    known = np.ndim(counts) == 1 or isinstance(counts, str)
    if not known or len(counts) != len(axes):
        number = "three" if len(axes) == 3 else "two"
        raise InvalidInputError(f"counts must be {number} integers, got {brief(counts)}: for {_listed(axes)}")
    for direction, count in enumerate(counts):
        check_count(count, f"counts[{direction}]")
    require_room(*counts)
    return [int(count) for count in counts]


def _listed(axes: str) -> str:
    return f"{', '.join(axes[:-1])} and {axes[-1]}"


def checked_ticks(
    lower: ArrayLike, upper: ArrayLike, counts: Sequence[int], grading: Sequence[float], axes: str
) -> list[np.ndarray]:
    """Return the coordinates of the ends of cells along every axis; arguments as for `block`."""
    low, high = checked_corners(lower, upper, axes)
    whole = checked_counts(counts, axes)
    check_row(grading, "grading", len(axes))
    if max(map(abs, grading)) > STEEPEST:
        raise InvalidInputError(
            f"grading must lie between {-STEEPEST:g} and {STEEPEST:g}, got {brief(grading)}: 0 is uniform"
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

    `grading`: logarithm of the growth over the whole of [0, 1], 0 for equal intervals.
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
    """Sort the boundary faces of a box or rectangle along the axes by their direction, see `SIDES`."""
    dim = points.shape[1]
    facets, _ = boundary_faces(cells, dim)
    areas = vector_areas(points, facets)
    direction = np.argmax(np.abs(areas), axis=1)
    upper = np.take_along_axis(areas, direction[:, None], axis=1)[:, 0] > 0
    side = 2 * direction + upper
    return {name: facets[side == s] for s, name in enumerate(SIDES[: 2 * dim])}


def extrude(section: BodyMesh, heights: ArrayLike, *, present: ArrayLike | None = None) -> BodyMesh:
    """Sweep a plane mesh along z, layer by layer.

    `present`: whether a cell of the section is there in a layer, (n_layers, n_cells) bool; everywhere unless
    given. With it a bolt is swept at once: its head is wider than its shank. Surfaces are "bottom" and "top",
    which face along z wherever cells end, and the section's, swept. Walls inside the section, where a cell is
    present and its neighbour is not, are in no surface. The section's regions and the shapes of its curves
    are swept, too. No grid.
    """
    require_cells("extrude", section, "quadrilateral", "quadrilaterals")
    try:
        z = np.asarray(heights, dtype=np.float64)
    except (TypeError, ValueError, OverflowError):
        z = np.zeros(0)
    if z.ndim != 1 or z.size < 2 or not np.all(np.diff(z) > 0):
        raise InvalidInputError(f"heights must be at least two ascending numbers, got {brief(heights)}")
    require_room(section.n_cells, z.size - 1, 1)
    there = _checked_presence(present, (z.size - 1, section.n_cells))
    layer, cell = np.nonzero(there)
    below = section.cells[cell] + section.n_nodes * layer[:, None]
    used, cells = np.unique(np.hstack([below, below + section.n_nodes]), return_inverse=True)
    plane = section.points[used % section.n_nodes]
    points = np.column_stack([plane, z[used // section.n_nodes]])
    cells = cells.reshape(-1, 8)
    surfaces = _surfaces(section, used, cells, z.size - 1)
    regions = {name: np.flatnonzero(np.isin(cell, members)) for name, members in section.regions.items()}
    shapes = {name: _swept(shape) for name, shape in section.shapes.items() if name in surfaces}
    named = {name: members for name, members in regions.items() if members.size}
    return BodyMesh(points, cells, surfaces, None, named, shapes=shapes)


def _swept(curve: SurfaceShape) -> Extruded:
    return Extruded(curve, (0.0, 0.0, 0.0), axis=(0.0, 0.0, 1.0), across=(1.0, 0.0, 0.0))


def _checked_presence(present: ArrayLike | None, shape: tuple[int, int]) -> np.ndarray:
    if present is None:
        return np.ones(shape, dtype=bool)
    there = np.asarray(present, dtype=bool)
    if there.shape != shape or not there.any():
        raise InvalidInputError(
            f"present must have shape {shape} (layers, cells) and hold some cell, got {there.shape}: mark it"
        )
    return there


def _surfaces(section: BodyMesh, used: np.ndarray, cells: np.ndarray, layers: int) -> dict[str, np.ndarray]:
    """Name boundary faces: flat ones by their direction, the others by the edge that was swept."""
    faces, _ = boundary_faces(cells)
    old = used[faces]
    height = old // section.n_nodes
    flat = np.ptp(height, axis=1) == 0
    low, high = cells[:, :4], cells[:, 4:]
    named = {"bottom": faces[match_faces(faces, low) >= 0], "top": faces[match_faces(faces, high) >= 0]}
    walls = faces[~flat]
    # The two lower nodes of a wall are the edge from which it was swept.
    order = np.argsort(height[~flat], axis=1, kind="stable")[:, :2]
    edges = np.take_along_axis(old[~flat], order, axis=1) % section.n_nodes
    for name, swept in section.surfaces.items():
        named[name] = walls[match_faces(edges, swept) >= 0]
    return {name: facets for name, facets in named.items() if facets.size}


def rectangle(
    lower: Sequence[float],
    upper: Sequence[float],
    counts: tuple[int, int],
    cell: str = "quadrilateral",
    *,
    grading: Sequence[float] = (0.0, 0.0),
) -> BodyMesh:
    """Mesh the rectangle between two corners, with surfaces x0, x1, y0 and y1.

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
    """Split every quadrilateral into two triangles along a diagonal, on the same nodes.

    `mirrored`: (n_cells,) bool: whether the diagonal runs from vertex 1 to vertex 3 and not from vertex 0 to
    vertex 2; nowhere unless given.
    """
    require_cells("split_quadrilaterals", mesh, "quadrilateral", "quadrilaterals")
    cells = mesh.cells
    if mirrored is not None:
        cells = np.where(mirrored[:, None], np.roll(cells, -1, axis=1), cells)
    triangles = cells[:, CELL_TYPES["quadrilateral"].simplices].reshape(-1, 3)
    grid = None if mesh.grid is None else np.repeat(mesh.grid, 2, axis=0)
    regions = repeated_regions(mesh, 2)
    return BodyMesh(
        mesh.points, triangles, mesh.surfaces, grid, regions, mesh.coincident_nodes, mesh.shapes
    ).with_chart(mesh.chart)


def growing_ticks(length: float, first: float, ratio: float) -> np.ndarray:
    """Divide a length into cells of which each is longer than the one before by the same ratio.

    For `box_lattice` and `rectangle_lattice`, whose lines may be put together of such pieces.

    Args:
        length: Length, [length].
        first: Length of the first cell, which is made shorter so that they fit, [length].
        ratio: Length of a cell by that of the one before.

    Returns:
        Ascending ticks from 0 to ``length``, shape (n + 1,).

    Raises:
        InvalidInputError: If a length is not positive, cells do not grow, or they are too many.
    """
    check_numbers(length=length, first=first, ratio=ratio)
    if min(length, first) <= 0.0 or ratio <= 1.0:
        raise InvalidInputError(
            f"length, first > 0 and ratio > 1 are needed, got {length}, {first} and {ratio}: or use linspace"
        )
    count = int(np.ceil(np.log1p(length * (ratio - 1.0) / first) / np.log(ratio)))
    require_room(count, 1)
    ends = np.cumsum(np.append(0.0, ratio ** np.arange(count)))
    return np.asarray(length * ends / ends[-1], dtype=np.float64)
