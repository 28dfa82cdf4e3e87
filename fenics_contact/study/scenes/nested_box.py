"""A quarter of a block, fine at one corner and coarser with the distance from it, all cells nearly cubes."""

from __future__ import annotations

import numpy as np

from fenics_contact.geometry import BodyMesh, box_lattice, split_hexahedra
from fenics_contact.geometry.block import box_sides

#: Vertex of a hexahedron by whether it lies above its middle in x (1), y (2) and z (4).
VERTEX = np.array([0, 1, 3, 2, 4, 5, 7, 6])


def nested_box(core: float, size: float, count: int, cell: str = "hexahedron") -> BodyMesh:
    """Mesh the cube [0, size]³: equal cells near the origin, layers around them that grow with the distance.

    A lattice graded along its axes drags its fine spacing through the whole body, so that far cells become
    slender and the dual problem hard; here every layer is a copy of the one inside it, enlarged.

    Args:
        core: Side of the cube of equal cells, [length].
        size: Side of the body, [length].
        count: Cells along the side of the core.
        cell: "hexahedron" or "tetrahedron".

    Returns:
        The mesh with surfaces ``x0, x1, y0, y1, z0, z1``.
    """
    inner = box_lattice([np.linspace(0.0, core, count + 1)] * 3)
    sides = [_facing(inner, axis) for axis in range(3)]
    skin = np.unique(np.concatenate([facets.ravel() for facets, _ in sides]))
    layers = max(1, round(np.log(size / core) / np.log1p(1.0 / count)))
    scales = (size / core) ** (np.arange(1, layers + 1) / layers)
    shells = scales[:, None, None] * inner.points[skin]
    rows = np.vstack([skin, inner.n_nodes + np.arange(layers * skin.size).reshape(layers, skin.size)])
    cells = [inner.cells]
    for facets, place in sides:
        local = np.searchsorted(skin, facets)
        stacked = np.concatenate([rows[:-1, local], rows[1:, local]], axis=-1).reshape(-1, 8)
        ordered = np.empty_like(stacked)
        np.put_along_axis(ordered, np.tile(place, (layers, 1)), stacked, axis=1)
        cells.append(ordered)
    points, hexahedra = np.concatenate([inner.points, shells.reshape(-1, 3)]), np.concatenate(cells)
    mesh = BodyMesh(points, hexahedra, box_sides(points, hexahedra))
    return mesh if cell == "hexahedron" else split_hexahedra(mesh)


def _facing(inner: BodyMesh, axis: int) -> tuple[np.ndarray, np.ndarray]:
    """Return the facets of the core that face along an axis, and the places of their nodes in a hexahedron.

    Cells of all layers are numbered along the axes like those of a lattice, with the way outwards in place of
    their own axis: then all can be split alike.

    Returns:
        Facets, (n, 4), and the vertex numbers of their inner copies, then of their outer ones, (n, 8).
    """
    facets = inner.surfaces[f"{'xyz'[axis]}1"]
    corners = inner.points[facets]
    above = corners > corners.mean(axis=1, keepdims=True)
    above[..., axis] = False
    code = above @ np.array([1, 2, 4])
    return facets, VERTEX[np.concatenate([code, code + (1 << axis)], axis=1)]


def mirrored(mesh: BodyMesh) -> BodyMesh:
    """Return the mesh mirrored at the plane z = 0; its lower face becomes the upper one.

    Args:
        mesh: Hexahedra or tetrahedra with the surfaces of a box.
    """
    points = mesh.points * np.array([1.0, 1.0, -1.0])
    cells = mesh.cells[:, [4, 5, 6, 7, 0, 1, 2, 3] if mesh.cells.shape[1] == 8 else [1, 0, 2, 3]]
    return BodyMesh(points, cells, box_sides(points, cells))
