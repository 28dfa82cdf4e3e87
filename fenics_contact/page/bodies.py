"""What a page draws of a body: its skin, its edges, and the cells to cut through."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

import numpy as np

from fenics_contact.mesh import boundary_faces
from fenics_contact.page.packing import Arrays
from fenics_contact.viz import linear_cells

if TYPE_CHECKING:
    import pyvista


def body_entry(name: str, grid: pyvista.UnstructuredGrid, arrays: Arrays) -> dict[str, Any]:
    """Return the geometry and the fields of a body as numbers of arrays.

    Returns:
        ``points``, (n, 3); ``triangles``, (t, 3) nodes of the skin, and the cell ``owner`` of each, (t,);
        ``edges`` and ``outline``, (e, 2) nodes of the lines of the mesh on the skin and of its sharp edges;
        ``cells``, (c, 3 | 4 | 8) corners; ``nodes`` and ``on_cells``, the fields by name. Quadratic cells are
        cut into linear ones.
    """
    cells, pieces, dim = linear_cells(name, grid)
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
