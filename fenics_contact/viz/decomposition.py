"""Picture of the bodies cut into subdomains."""

from __future__ import annotations

from collections.abc import Mapping
from pathlib import Path
from typing import TYPE_CHECKING, BinaryIO

import numpy as np
import pyvista as pv
from matplotlib.axes import Axes
from matplotlib.collections import PolyCollection

from fenics_contact.contact import body_grid, in_space
from fenics_contact.display import counted
from fenics_contact.errors import InvalidInputError
from fenics_contact.mesh import BodyMesh
from fenics_contact.scene import Scene
from fenics_contact.viz.colours import INK, colour_subdomains, neighbours
from fenics_contact.viz.picture import Picture, draw_picture, png_path
from fenics_contact.viz.plane import draw_cell_edges, draw_outline
from fenics_contact.viz.sheet import sheet, show_image
from fenics_contact.viz.stage import Layer, render
from fenics_contact.viz.view import IN_PLANE, Frame, frame_around, oblique_view
from fenics_contact.viz.words import written

if TYPE_CHECKING:
    from mpi4py import MPI


def plot_decomposition(
    scene: Scene,
    partitions: Mapping[str, np.ndarray],
    path: str | Path | None = None,
    *,
    explode: float = 0.0,
    width: int = 1600,
    comm: MPI.Comm | None = None,
) -> Picture:
    """Draw the subdomains of all bodies; neighbours have different colours.

    Args:
        scene: The bodies.
        partitions: Body name -> subdomain of every cell, numbered from 0 within the body.
        path: PNG file to write, None to write none.
        explode: Shrinkage of each subdomain towards its centre, from 0 (whole bodies) to below 1.
        width: Width of the picture in pixels.
        comm: If given, only rank 0 draws, and an error is raised on all ranks; collective then.

    Returns:
        The picture, which can be used like a path to its file.

    Raises:
        InvalidInputError: If a partition does not fit its body or ``explode`` is out of range.
        MissingRequirementError: If this machine cannot render.
    """
    target = png_path(path)
    if not 0.0 <= explode < 1.0:
        raise InvalidInputError(f"explode must be at least 0 and below 1, got {explode}: try 0.1")
    for name, body in scene.bodies.items():
        shape = np.shape(partitions[name]) if name in partitions else "none"
        if shape != (body.mesh.n_cells,):
            raise InvalidInputError(
                f"partitions[{name!r}] must have shape ({body.mesh.n_cells},), one subdomain per cell, got "
                f"{shape}: pass the partitions that the scene was cut with"
            )
    count = sum(np.unique(partitions[name]).size for name in scene.bodies)
    cells = sum(body.mesh.n_cells for body in scene.bodies.values())
    bodies = counted(len(scene.bodies), "body", "bodies")
    title = f"{counted(count, 'subdomain')} of {bodies}, {written(cells)} cells"
    parts = [_linear(body.mesh, partitions[name]) for name, body in scene.bodies.items()]
    points = in_space(np.concatenate([mesh.points for mesh, _ in parts]))
    plane = scene.dim == 2
    view = IN_PLANE if plane else oblique_view(points)
    frame = frame_around(view, points, 0.03 if plane else 0.02)
    height = float(np.clip((0.85 if plane else 1.0) / frame.proportion + 0.08, 0.2, 1.2))

    def draw(paper: BinaryIO) -> None:
        with sheet(paper, (width, round(height * width)), title) as figure:
            axes = figure.subplots()
            if plane:
                for family, (mesh, partition) in enumerate(parts):
                    _draw_plane_body(axes, mesh, partition, family, explode, frame)
                frame.fit(axes)
                axes.set_axis_off()
            else:
                layers = [
                    layer for family, part in enumerate(parts) for layer in _layers(*part, family, explode)
                ]
                show_image(axes, render(layers, view, frame, width), frame)

    return draw_picture(comm, target, draw)


def _linear(mesh: BodyMesh, partition: np.ndarray) -> tuple[BodyMesh, np.ndarray]:
    """Return the linear cells to draw and the subdomain of each."""
    return mesh.linear, np.repeat(np.asarray(partition), mesh.linear.n_cells // mesh.n_cells)


def _draw_plane_body(
    axes: Axes, mesh: BodyMesh, partition: np.ndarray, family: int, explode: float, frame: Frame
) -> None:
    colours = colour_subdomains(neighbours(mesh.cells, partition), family)
    for number in np.unique(partition):
        cells = mesh.cells[partition == number]
        centre = mesh.points[np.unique(cells)].mean(axis=0)
        points = centre + (1.0 - explode) * (mesh.points - centre)
        # Faces with borders in their own colour: otherwise the white background shows between them.
        axes.add_collection(PolyCollection(points[cells], color=colours[number], linewidths=0.4))
        draw_outline(axes, points, cells, width=2.0)
    if not explode:
        draw_cell_edges(axes, mesh.points, mesh.cells, frame)


def _layers(mesh: BodyMesh, partition: np.ndarray, family: int, explode: float) -> list[Layer]:
    """Draw the subdomains of a body, neighbours in different colours, and the seams between them."""
    colours, layers = colour_subdomains(neighbours(mesh.cells, partition), family), []
    grid = body_grid(mesh, mesh.points)
    grid.cell_data["subdomain"] = partition
    skin = grid.extract_surface(algorithm=None)
    look = {"show_edges": True, "edge_color": INK, "edge_opacity": 0.25, "ambient": 0.5, "diffuse": 0.55}
    for number in np.unique(partition):
        piece: pv.PolyData = grid.extract_cells(partition == number).extract_surface(algorithm=None)
        centre = piece.points.mean(axis=0)
        piece.points = centre + (1.0 - explode) * (piece.points - centre)
        layers.append(Layer(piece, {"color": colours[number], "line_width": 1, **look}))
        seen = skin.extract_cells(skin["subdomain"] == number)
        if not explode and 0 < seen.n_cells < skin.n_cells:
            seam = seen.extract_feature_edges(feature_edges=False, manifold_edges=False)
            layers.append(Layer(seam, {"color": INK, "line_width": 4, "lighting": False}))
    return layers
