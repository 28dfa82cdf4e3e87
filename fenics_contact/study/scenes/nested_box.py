"""Blocks and rectangles that are fine at one point and coarsen with distance, all cells nearly cubes.

A lattice graded along its axes carries its fine spacing through the whole body, so that far cells become
slender and the dual problem ill-conditioned; here every layer is an enlarged copy of the one inside it.
"""

from __future__ import annotations

import numpy as np

from fenics_contact.gallery.blocks import (
    box_lattice,
    box_sides,
    rectangle_lattice,
    split_hexahedra,
    split_quadrilaterals,
)
from fenics_contact.mesh.body_mesh import BodyMesh

#: Vertex of a hexahedron by whether it lies above its middle in x (1), y (2) and z (4).
VERTEX = np.array([0, 1, 3, 2, 4, 5, 7, 6])
#: Order of the vertices of a mirrored cell.
TURNED = {
    "hexahedron": [4, 5, 6, 7, 0, 1, 2, 3],
    "tetrahedron": [1, 0, 2, 3],
    "quadrilateral": [1, 0, 3, 2],
    "triangle": [1, 0, 2],
}


def nested_box(core: float, size: float, count: int, cell: str = "hexahedron") -> BodyMesh:
    """Mesh the cube [0, size]³: equal cells near the origin, layers around them that grow with the distance.

    `core`: side of the cube of equal cells. Surfaces are ``x0, x1, y0, y1, z0, z1``.
    """
    inner = box_lattice([np.linspace(0.0, core, count + 1)] * 3)
    sides = [_facing(inner, axis) for axis in range(3)]
    points, skin, rows = _shells(inner, [facets for facets, _ in sides], core, size, count)
    cells = [inner.cells]
    for facets, place in sides:
        local = np.searchsorted(skin, facets)
        stacked = np.concatenate([rows[:-1, local], rows[1:, local]], axis=-1).reshape(-1, 8)
        ordered = np.empty_like(stacked)
        np.put_along_axis(ordered, np.tile(place, (len(rows) - 1, 1)), stacked, axis=1)
        cells.append(ordered)
    hexahedra = np.concatenate(cells)
    mesh = BodyMesh(points, hexahedra, box_sides(points, hexahedra))
    return mesh if cell == "hexahedron" else split_hexahedra(mesh)


def nested_half(core: float, size: float, count: int, cell: str = "quadrilateral") -> BodyMesh:
    """Mesh the rectangle [−size, size] × [0, size] in the same way.

    `core`: half the width, and the height, of the rectangle of equal cells.
    """
    inner = rectangle_lattice([np.linspace(-core, core, 2 * count + 1), np.linspace(0.0, core, count + 1)])
    sides = [inner.surfaces[side] for side in ("x0", "x1", "y1")]
    points, skin, rows = _shells(inner, sides, core, size, count)
    local = np.searchsorted(skin, np.concatenate(sides))
    # Edges have the body on their left: for the next layer they run in the other direction.
    stacked = np.concatenate([rows[:-1, local[:, ::-1]], rows[1:, local]], axis=-1).reshape(-1, 4)
    cells = np.concatenate([inner.cells, stacked])
    mesh = BodyMesh(points, cells, box_sides(points, cells))
    return mesh if cell == "quadrilateral" else split_quadrilaterals(mesh)


def _shells(
    inner: BodyMesh, sides: list[np.ndarray], core: float, size: float, count: int
) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Enlarge the skin of the core, layer by layer.

    Returns all points; the nodes of the skin, ascending; and the nodes of all layers, that of the core first.
    """
    skin = np.unique(np.concatenate([facets.ravel() for facets in sides]))
    layers = max(1, round(np.log(size / core) / np.log1p(1.0 / count)))
    scales = (size / core) ** (np.arange(1, layers + 1) / layers)
    shells = scales[:, None, None] * inner.points[skin]
    rows = np.vstack([skin, inner.n_nodes + np.arange(layers * skin.size).reshape(layers, skin.size)])
    return np.concatenate([inner.points, shells.reshape(-1, inner.dim)]), skin, rows


def _facing(inner: BodyMesh, axis: int) -> tuple[np.ndarray, np.ndarray]:
    """Return the facets of the core normal to an axis, and the positions of their nodes in a hexahedron.

    Cells of all layers are numbered along the axes like those of a lattice, with the outward direction in
    place of their own axis, so that all can be split alike. The positions are those of the inner copies, then
    of the outer ones.
    """
    facets = inner.surfaces[f"{'xyz'[axis]}1"]
    corners = inner.points[facets]
    above = corners > corners.mean(axis=1, keepdims=True)
    above[..., axis] = False
    code = above @ np.array([1, 2, 4])
    return facets, VERTEX[np.concatenate([code, code + (1 << axis)], axis=1)]


def mirrored(mesh: BodyMesh) -> BodyMesh:
    """Return the mesh mirrored at z = 0, or y = 0 in the plane; its lower face becomes the upper one."""
    points = mesh.points * np.array([1.0, 1.0, -1.0])[-mesh.dim :]
    cells = mesh.cells[:, TURNED[mesh.cell_type]]
    return BodyMesh(points, cells, box_sides(points, cells))
