"""The cells of a meshio mesh that bodies can have, in the order of VTK and right-handed."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np

from fenics_contact.errors import InvalidInputError
from fenics_contact.mesh import cell_type_of, flattened, in_vtk_order, turned_right_handed

if TYPE_CHECKING:
    import meshio

_CORNERS = {"triangle": 3, "quad": 4, "tetra": 4, "hexahedron": 8}
_SERENDIPITY_OR_LAGRANGE = {
    "triangle6": "triangle", "quad8": "quad", "quad9": "quad",
    "hexahedron20": "hexahedron", "hexahedron27": "hexahedron", "tetra10": "tetra",
}  # fmt: skip
"""meshio's name of a quadratic cell to that of the linear cell."""


@dataclass(frozen=True)
class Block:
    """The role of a block of a meshio mesh.

    Attributes:
        kind: Type of cells, None for a block that holds no cells of the bodies.
        start: Number of its first cell among those of its type.
        facets: Corners of its facets, (n, 4 | 3 | 2), None for a block that holds none.
        size: Number of its cells of any kind.
    """

    kind: str | None
    start: int
    facets: np.ndarray | None
    size: int


def cells_of(
    mesh: meshio.Mesh, source: str, corners_only: bool
) -> tuple[np.ndarray, list[Block], dict[str, np.ndarray]]:
    """Sort the blocks of a mesh into cells and facets.

    Args:
        mesh: The mesh.
        source: Where it comes from, for messages.
        corners_only: Whether quadratic cells are reduced to their corners.

    Returns:
        Coordinates, (n_nodes, 3 | 2), the role of each block, and cell type to nodes, (n_cells, nodes of a
        cell).

    Raises:
        InvalidInputError: If there are no cells, or prisms, pyramids or others that bodies cannot have.
    """
    dim = max((block.dim for block in mesh.cells if len(block)), default=0)
    if dim < 2:
        raise InvalidInputError(
            f"{source} must hold cells, it has {_counted(mesh)}: save the tetrahedra or hexahedra of the "
            "bodies, of plane ones the triangles or quadrilaterals"
        )
    used = [_nodes(block, mesh, source, corners_only) for block in mesh.cells if block.dim == dim]
    points = np.array(mesh.points, dtype=np.float64)
    blocks_of: dict[int, list[np.ndarray]] = {}
    for nodes in used:
        blocks_of.setdefault(nodes.shape[1], []).append(nodes)
    joined = {columns: np.concatenate(parts) for columns, parts in blocks_of.items()}
    if dim == 2:
        points = flattened(points, np.concatenate([nodes.ravel() for nodes in joined.values()]), source)
    cells: dict[str, np.ndarray] = {}
    kinds: dict[int, str] = {}
    for columns, nodes in joined.items():
        if columns > (8 if dim == 3 else 4):
            points, nodes = in_vtk_order(points, nodes)
        kind = kinds[columns] = cell_type_of(nodes, dim).name
        if kind in cells:
            raise InvalidInputError(
                f"quadratic cells must have one number of nodes, {source} has {_counted(mesh)}: save it with "
                "one of them, or read it with corners_only=True"
            )
        cells[kind] = turned_right_handed(points, nodes, source)
    return points, _blocks(mesh, dim, kinds, corners_only), cells


def _nodes(block: meshio.CellBlock, mesh: meshio.Mesh, source: str, corners_only: bool) -> np.ndarray:
    name = block.type
    linear = _SERENDIPITY_OR_LAGRANGE.get(name, name)
    if linear not in _CORNERS:
        raise InvalidInputError(
            "cells must be tetrahedra or hexahedra (in two dimensions triangles or quadrilaterals), "
            f"{source} has {_counted(mesh)}: mesh it without cells of type '{name}'"
        )
    nodes = np.array(block.data, dtype=np.int64)
    return nodes[:, : _CORNERS[linear]] if corners_only else nodes


def _blocks(mesh: meshio.Mesh, dim: int, kinds: Mapping[int, str], corners_only: bool) -> list[Block]:
    blocks, count = [], dict.fromkeys(kinds.values(), 0)
    for block in mesh.cells:
        size = len(block)
        if block.dim == dim:
            corners = _CORNERS[_SERENDIPITY_OR_LAGRANGE.get(block.type, block.type)]
            kind = kinds[corners if corners_only else block.data.shape[1]]
            blocks.append(Block(kind, count[kind], None, size))
            count[kind] += size
            continue
        corners = 2 if dim == 2 else _CORNERS.get(_SERENDIPITY_OR_LAGRANGE.get(block.type, block.type), 0)
        usable = block.dim == dim - 1 and corners
        blocks.append(Block(None, 0, np.array(block.data)[:, :corners] if usable else None, size))
    return blocks


def _counted(mesh: meshio.Mesh) -> str:
    counts: dict[str, int] = {}
    for block in mesh.cells:
        counts[block.type] = counts.get(block.type, 0) + len(block)
    return ", ".join(f"{count} of type '{name}'" for name, count in counts.items()) or "none at all"
