"""What a page draws of a body: its skin, its edges, and the cells to cut through."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

import numpy as np

from fenics_contact.errors import InvalidInputError
from fenics_contact.mesh import boundary_faces, cell_type_of
from fenics_contact.page.packing import Arrays

if TYPE_CHECKING:
    import pyvista


def body_entry(name: str, grid: pyvista.UnstructuredGrid, arrays: Arrays) -> dict[str, Any]:
    """Return the geometry and the fields of a body as numbers of arrays.

    Args:
        name: Name of the body.
        grid: Its undeformed mesh in space with fields, cells of one type.
        arrays: Receives the arrays.

    Returns:
        ``points``, (n, 3); ``triangles``, (t, 3) nodes of the skin, and the cell ``owner`` of each, (t,);
        ``edges`` and ``outline``, (e, 2) nodes of the lines of the mesh on the skin and of its sharp edges;
        ``cells``, (c, 3 | 4 | 8) corners; ``nodes`` and ``on_cells``, the fields by name. Quadratic cells are
        cut into linear ones.
    """
    cells, pieces, dim = _linear_cells(name, grid)
    faces, owner = boundary_faces(cells, 3) if dim == 3 else (cells, np.arange(len(cells)))
    quads = faces.shape[1] == 4
    triangles = np.concatenate([faces[:, [0, 1, 2]], faces[:, [0, 2, 3]]]) if quads else faces
    edges, outline = _lines(np.asarray(grid.points), faces)
    return {
        "points": arrays.add(np.asarray(grid.points), exact=True),
        "triangles": arrays.add(triangles),
        "owner": arrays.add(np.tile(owner, 2) if quads else owner),
        "edges": arrays.add(edges),
        "outline": arrays.add(outline),
        "cells": arrays.add(cells),
        "nodes": {key: arrays.add(np.asarray(values)) for key, values in grid.point_data.items()},
        "on_cells": {
            key: arrays.add(np.repeat(np.asarray(values), pieces, axis=0))
            for key, values in grid.cell_data.items()
        },
    }


def is_plane(grid: pyvista.UnstructuredGrid) -> bool:
    """Return whether a body is plane."""
    return int(grid.get_cell(0).dimension) == 2


def _linear_cells(name: str, grid: pyvista.UnstructuredGrid) -> tuple[np.ndarray, int, int]:
    """Return the nodes of linear cells, how many of them one of the grid makes, and their dimension."""
    if grid.n_cells == 0 or len(np.unique(grid.celltypes)) != 1:
        raise InvalidInputError(
            f"a page needs bodies with cells of one type, {name!r} has {len(np.unique(grid.celltypes))} "
            "types: give files that write_vtu or ResultSeries wrote"
        )
    dim = 2 if is_plane(grid) else 3
    cells = np.asarray(grid.cell_connectivity).reshape(grid.n_cells, -1)
    kind = cell_type_of(cells, dim)
    if kind.order == 1:
        return cells, 1, dim
    return cells[:, kind.pieces].reshape(-1, kind.pieces.shape[1]), len(kind.pieces), dim


def _lines(points: np.ndarray, faces: np.ndarray, sharp: float = 30.0) -> tuple[np.ndarray, np.ndarray]:
    """Return all edges of faces, and those at ends and where faces meet at a larger angle, (n, 2) each."""
    import pyvista as pv

    skin = pv.PolyData.from_regular_faces(points, faces)
    skin.point_data["node"] = np.arange(len(points))
    # Nodes of cells keep their numbers; lines are between nodes of their own.
    found = (skin.extract_all_edges(), skin.extract_feature_edges(feature_angle=sharp, manifold_edges=False))
    first, second = (
        np.asarray(lines.point_data["node"])[np.asarray(lines.lines).reshape(-1, 3)[:, 1:]]
        if lines.n_cells
        else np.zeros((0, 2), dtype=np.int64)
        for lines in found
    )
    return first, second
