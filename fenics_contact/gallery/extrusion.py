"""Solids swept from a plane mesh: every quadrilateral becomes a column of hexahedra."""

from __future__ import annotations

import numpy as np
from numpy.typing import ArrayLike

from fenics_contact.checks import brief
from fenics_contact.errors import InvalidInputError
from fenics_contact.gallery.memory import require_room
from fenics_contact.mesh import BodyMesh, boundary_faces, match_faces
from fenics_contact.surface_shapes import Extruded, SurfaceShape


def extrude(section: BodyMesh, heights: ArrayLike, *, present: ArrayLike | None = None) -> BodyMesh:
    """Sweep a plane mesh along z.

    Args:
        section: Quadrilaterals in the x-y plane.
        heights: Ascending z of the layers' planes, (n_layers + 1,).
        present: Whether a cell of the section is there in a layer, (n_layers, n_cells) bool; everywhere
            unless given. With it a bolt is swept at once: its head is wider than its shank.

    Returns:
        Hexahedra, layer by layer. Surfaces are "bottom" and "top", which face along z wherever cells end, and
        the section's, swept. Walls inside the section, where a cell is present and its neighbour is not, are
        in no surface. The section's regions and the shapes of its curves are swept, too. No grid.

    Raises:
        InvalidInputError: If the section is not a mesh of quadrilaterals, heights do not ascend, or
            ``present`` has another shape.
    """
    if section.cell_type != "quadrilateral":
        raise InvalidInputError(
            f"extrude needs a section of quadrilaterals, got cells of type {section.cell_type}: mesh the "
            "plane with quadrilaterals"
        )
    try:
        z = np.asarray(heights, dtype=np.float64)
    except (TypeError, ValueError, OverflowError):
        z = np.zeros(0)
    if z.ndim != 1 or z.size < 2 or not np.all(np.diff(z) > 0):
        raise InvalidInputError(
            f"heights must be at least two ascending numbers, got {brief(heights)}: give the z of every "
            "plane between layers, and of both ends"
        )
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
            f"present must have shape {shape}, one row per layer and one column per cell of the section, and "
            f"hold some cell, got shape {there.shape}: say for each layer which cells are there"
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
