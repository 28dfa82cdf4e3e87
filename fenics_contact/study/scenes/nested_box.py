"""A quarter of a block, fine at one corner and coarser with the distance from it, all cells nearly cubes."""

from __future__ import annotations

import numpy as np

from fenics_contact.geometry import BodyMesh, box_lattice, split_hexahedra
from fenics_contact.geometry.block import box_sides


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
    facets = np.concatenate([inner.surfaces[side] for side in ("x1", "y1", "z1")])
    skin, local = np.unique(facets, return_inverse=True)
    local = local.reshape(facets.shape)
    layers = max(1, round(np.log(size / core) / np.log1p(1.0 / count)))
    scales = (size / core) ** (np.arange(1, layers + 1) / layers)
    shells = scales[:, None, None] * inner.points[skin]
    rows = np.vstack([skin, inner.n_nodes + np.arange(layers * skin.size).reshape(layers, skin.size)])
    stacked = np.concatenate([rows[:-1, local], rows[1:, local]], axis=-1).reshape(-1, 8)
    points = np.concatenate([inner.points, shells.reshape(-1, 3)])
    cells = np.concatenate([inner.cells, stacked])
    mesh = BodyMesh(points, cells, box_sides(points, cells))
    return mesh if cell == "hexahedron" else split_hexahedra(mesh)


def mirrored(mesh: BodyMesh) -> BodyMesh:
    """Return the mesh mirrored at the plane z = 0; its lower face becomes the upper one.

    Args:
        mesh: Hexahedra with the surfaces of a box.
    """
    points = mesh.points * np.array([1.0, 1.0, -1.0])
    cells = mesh.cells[:, [4, 5, 6, 7, 0, 1, 2, 3]]
    return BodyMesh(points, cells, box_sides(points, cells))
