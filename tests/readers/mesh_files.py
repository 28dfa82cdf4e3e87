"""Two blocks in the formats of other programs, written by meshio or by hand."""

from __future__ import annotations

from collections.abc import Sequence

import meshio
import numpy as np

from fenics_contact import BodyMesh
from fenics_contact.gallery import block
from fenics_contact.mesh.faces import vector_areas


def bodies() -> dict[str, BodyMesh]:
    """A table of 2 x 1 x 1 and a unit cube above it, of hexahedra."""
    return {
        "table": block((0, 0, 0), (2, 1, 1), (2, 2, 2)),
        "tool": block((0, 0, 1.5), (1, 1, 2.5), (3, 1, 2)),
    }


def joined(meshes: Sequence[BodyMesh] | None = None) -> meshio.Mesh:
    """Return both bodies in one mesh: a block of cells each, then a block of facets each for two surfaces.

    Cell sets "table" and "tool", of facets "bottom" and "top"; node sets "held" and "pushed" at the same
    places; a node that no cell has at the end.
    """
    table, tool = list(bodies().values()) if meshes is None else meshes
    shift = table.n_nodes
    cells = [table.cells, tool.cells + shift]
    facets = [table.surfaces["z0"], tool.surfaces["z1"] + shift]
    blocks = [("hexahedron", cells[0]), ("hexahedron", cells[1]), ("quad", facets[0]), ("quad", facets[1])]
    empty = np.zeros(0, dtype=np.int64)
    names = ("table", "tool", "bottom", "top")
    return meshio.Mesh(
        np.concatenate([table.points, tool.points, [[9.0, 9.0, 9.0]]]),
        blocks,
        cell_sets={
            name: [np.arange(len(rows)) if k == n else empty for k, (_, rows) in enumerate(blocks)]
            for n, name in enumerate(names)
        },
        point_sets={"held": np.unique(facets[0]), "pushed": np.unique(facets[1])},
    )


def with_tags(mesh: meshio.Mesh, name: str, tags: Sequence[int] = (1, 2, 11, 12)) -> meshio.Mesh:
    """Return the mesh with numbers instead of sets: one for each block."""
    data = [np.full(len(block.data), tag) for block, tag in zip(mesh.cells, tags, strict=True)]
    return meshio.Mesh(mesh.points, mesh.cells, cell_data={name: data})


def area(mesh: BodyMesh, surface: str) -> list[float]:
    """Return the integral of the outward normal over a surface."""
    return [float(x) for x in vector_areas(mesh.points, mesh.surfaces[surface]).sum(axis=0).round(12) + 0.0]
