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
from fenics_contact.viz.fields import cells_of
from fenics_contact.viz.picture import Picture, draw_picture, png_path
from fenics_contact.viz.plane import draw_cell_edges, draw_outline
from fenics_contact.viz.sheet import sheet, show_image
from fenics_contact.viz.stage import Layer, render
from fenics_contact.viz.view import IN_PLANE, frame_around, oblique_view
from fenics_contact.viz.words import written

if TYPE_CHECKING:
    from mpi4py import MPI

_LOOK = {
    "show_edges": True, "edge_color": INK, "edge_opacity": 0.25, "line_width": 1, "ambient": 0.5,
    "diffuse": 0.55,
}  # fmt: skip


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
        comm: If given, only rank 0 draws, and an error is raised on all ranks.

    Returns:
        The picture, which can be used like a path to its file.

    Raises:
        InvalidInputError: If a partition does not fit its body or ``explode`` is out of range.
        MissingRequirementError: If this machine cannot render.

    Note:
        Collective on ``comm`` if given.
    """
    target = png_path(path)
    if not 0.0 <= explode < 1.0:
        raise InvalidInputError(f"explode must be at least 0 and below 1, got {explode}: try 0.1")
    for name, body in scene.bodies.items():
        _check_partition(name, body.mesh, partitions)
    return draw_picture(comm, target, lambda paper: _draw(scene, partitions, paper, explode, width))


def _check_partition(name: str, mesh: BodyMesh, partitions: Mapping[str, np.ndarray]) -> None:
    shape = np.shape(partitions[name]) if name in partitions else "none"
    if shape != (mesh.n_cells,):
        raise InvalidInputError(
            f"partitions[{name!r}] must have shape ({mesh.n_cells},), one subdomain per cell, got {shape}: "
            "pass the partitions that the scene was cut with"
        )


def _draw(
    scene: Scene, partitions: Mapping[str, np.ndarray], paper: BinaryIO, explode: float, width: int
) -> None:
    count = sum(np.unique(partitions[name]).size for name in scene.bodies)
    cells = sum(body.mesh.n_cells for body in scene.bodies.values())
    title = f"{counted(count, 'subdomain')} of {counted(len(scene.bodies), 'body', 'bodies')}, "
    title += f"{written(cells)} cells"
    parts = [_linear(body.mesh, partitions[name]) for name, body in scene.bodies.items()]
    points = np.concatenate([mesh.points for mesh, _ in parts])
    if scene.dim == 2:
        _draw_in_plane(parts, points, paper, (explode, title, width))
        return
    layers = []
    for family, (mesh, partition) in enumerate(parts):
        layers += subdomain_layers(body_grid(mesh, mesh.points), partition, family, explode)
    view = oblique_view(points)
    frame = frame_around(view, points)
    image = render(layers, view, frame, width)
    with sheet(paper, (width, round((0.05 + 1 / frame.proportion) * width)), title) as figure:
        show_image(figure.subplots(), image, frame)


def _linear(mesh: BodyMesh, partition: np.ndarray) -> tuple[BodyMesh, np.ndarray]:
    """Return the linear cells to draw and the subdomain of each."""
    return mesh.linear, np.repeat(np.asarray(partition), mesh.linear.n_cells // mesh.n_cells)


def _draw_in_plane(
    parts: list[tuple[BodyMesh, np.ndarray]],
    points: np.ndarray,
    paper: BinaryIO,
    look: tuple[float, str, int],
) -> None:
    explode, title, width = look
    frame = frame_around(IN_PLANE, in_space(points), 0.03)
    height = float(np.clip(0.85 / frame.proportion + 0.1, 0.3, 1.0))
    with sheet(paper, (width, round(height * width)), title) as figure:
        axes = figure.subplots()
        for family, (mesh, partition) in enumerate(parts):
            _draw_plane_body(axes, mesh, partition, family, explode)
            if not explode:
                draw_cell_edges(axes, mesh.points, mesh.cells, frame)
        frame.fit(axes)
        axes.set_axis_off()


def _draw_plane_body(axes: Axes, mesh: BodyMesh, partition: np.ndarray, family: int, explode: float) -> None:
    colours = colour_subdomains(neighbours(mesh.cells, partition), family)
    for number in np.unique(partition):
        cells = mesh.cells[partition == number]
        centre = mesh.points[np.unique(cells)].mean(axis=0)
        points = centre + (1.0 - explode) * (mesh.points - centre)
        # Faces with borders in their own colour: otherwise the white background shows between them.
        axes.add_collection(PolyCollection(points[cells], color=colours[number], linewidths=0.4))
        draw_outline(axes, points, cells, width=2.0)


def subdomain_layers(
    grid: pv.UnstructuredGrid, partition: np.ndarray, family: int, explode: float = 0.0
) -> list[Layer]:
    """Draw the subdomains of a body, neighbours in different colours, and the seams between them.

    Args:
        grid: The body's linear cells.
        partition: Subdomain of every cell, (n_cells,).
        family: Preferred family of colours.
        explode: Shrinkage of each subdomain towards its centre.
    """
    colours = colour_subdomains(neighbours(cells_of(grid), partition), family)
    labelled, layers = grid.copy(deep=False), []
    labelled.cell_data["subdomain"] = partition
    skin = labelled.extract_surface(algorithm=None)
    for number in np.unique(partition):
        piece = grid.extract_cells(partition == number).extract_surface(algorithm=None)
        centre = piece.points.mean(axis=0)
        piece.points = centre + (1.0 - explode) * (piece.points - centre)
        layers.append(Layer(piece, {"color": colours[number], **_LOOK}))
        seen = skin.extract_cells(skin["subdomain"] == number)
        if not explode and 0 < seen.n_cells < skin.n_cells:
            seam = seen.extract_feature_edges(feature_edges=False, manifold_edges=False)
            layers.append(Layer(seam, {"color": INK, "line_width": 4, "lighting": False}))
    return layers
