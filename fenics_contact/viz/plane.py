"""Plane bodies drawn by matplotlib: meshes, fields and outlines on their coordinates."""

from __future__ import annotations

from typing import Any

import numpy as np
from matplotlib.axes import Axes
from matplotlib.collections import LineCollection, PolyCollection
from matplotlib.colors import to_rgb
from matplotlib.tri import Triangulation

from fenics_contact.mesh import boundary_faces
from fenics_contact.viz.colours import INK
from fenics_contact.viz.view import Frame

#: Edges closer than this, relative to the size of the picture, are faded, as they would blacken it.
CLOSEST = 0.009


def draw_field(
    axes: Axes, points: np.ndarray, cells: np.ndarray, values: np.ndarray, look: dict[str, Any]
) -> None:
    """Colour plane cells by nodal or cell values.

    Args:
        axes: Where to.
        points: Coordinates, (n_nodes, 2).
        cells: Node numbers, (n_cells, 3 | 4).
        values: Shape (n_nodes,) or (n_cells,).
        look: ``cmap``, ``vmin`` and ``vmax``.
    """
    if len(values) == len(points):
        mesh, shown = refined(points, cells, values)
        axes.tripcolor(mesh, shown, shading="gouraud", rasterized=True, **look)
        return
    faces = PolyCollection(points[cells], array=values, edgecolors="face", linewidths=0.2, cmap=look["cmap"])
    faces.set_clim(look["vmin"], look["vmax"])
    axes.add_collection(faces)


def refined(points: np.ndarray, cells: np.ndarray, values: np.ndarray) -> tuple[Triangulation, np.ndarray]:
    """Cut quadrilaterals into small triangles, so that colours are bilinear and favour no diagonal.

    Returns:
        The triangulation and the values on its nodes.
    """
    if cells.shape[1] == 3:
        return Triangulation(*points.T, cells), values
    ticks = np.linspace(0.0, 1.0, int(np.clip(100 / np.sqrt(len(cells)), 2, 6)) + 1)
    s, t = np.meshgrid(ticks, ticks, indexing="ij")
    shape = np.stack([(1 - s) * (1 - t), s * (1 - t), s * t, (1 - s) * t], axis=-1).reshape(-1, 4)
    number = np.arange(s.size).reshape(s.shape)
    a, b, c, d = (
        part.ravel() for part in (number[:-1, :-1], number[1:, :-1], number[1:, 1:], number[:-1, 1:])
    )
    small = np.concatenate([np.column_stack([a, b, c]), np.column_stack([a, c, d])])
    triangles = (small + s.size * np.arange(len(cells))[:, None, None]).reshape(-1, 3)
    places = np.einsum("kc,fcd->fkd", shape, points[cells]).reshape(-1, 2)
    return Triangulation(*places.T, triangles), (values[cells] @ shape.T).ravel()


def draw_outline(axes: Axes, points: np.ndarray, cells: np.ndarray, *, width: float = 1.2) -> None:
    """Draw the boundary of a plane body."""
    edges, _ = boundary_faces(cells, 2)
    axes.add_collection(LineCollection(points[edges], colors=INK, linewidths=width, capstyle="round"))


def draw_cell_edges(axes: Axes, points: np.ndarray, cells: np.ndarray, frame: Frame) -> None:
    """Draw the edges of cells inside a frame faintly, and fainter the smaller the cells are."""
    corners = points[cells]
    inside = np.all((corners.max(axis=1) > frame.low) & (corners.min(axis=1) < frame.high), axis=1)
    length = np.linalg.norm(corners - np.roll(corners, 1, axis=1), axis=2).min(axis=1)
    strength = 0.25 * np.minimum(1.0, (length / (CLOSEST * float(np.max(frame.size)))) ** 2)
    seen = inside & (strength > 0.01)
    colours = np.column_stack([np.tile(to_rgb(INK), (np.count_nonzero(seen), 1)), strength[seen]])
    look = {"facecolors": "none", "edgecolors": colours, "linewidths": 0.4}
    axes.add_collection(PolyCollection(corners[seen], **look))
