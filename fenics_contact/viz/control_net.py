"""Picture of a design surface and its control net, before and after."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING, BinaryIO

import numpy as np
import pyvista as pv
from matplotlib.axes import Axes
from matplotlib.cm import ScalarMappable
from matplotlib.collections import LineCollection
from matplotlib.colors import Normalize

from fenics_contact.errors import InvalidInputError
from fenics_contact.gallery import DesignSurface
from fenics_contact.viz.colours import GREY, INK, ORANGE, SIGNED_MAP
from fenics_contact.viz.picture import Picture, draw_picture, png_path
from fenics_contact.viz.sheet import add_colour_bar, sheet, show_image
from fenics_contact.viz.stage import Layer, balls, render
from fenics_contact.viz.units import Units
from fenics_contact.viz.view import Frame, View, frame_around, looking_along
from fenics_contact.viz.words import checked_range, headline, nice_number, written

if TYPE_CHECKING:
    from mpi4py import MPI

#: Apparent size of the largest movement relative to the surface.
VISIBLE = 0.06
#: Opacity of the surface.
OPACITY = 0.75
#: Fraction of the width for each of the two pictures.
PART = 0.45
#: Straight pieces of a bar of the net between two control points.
PIECES = 8

#: Before and after: of nodes in their order, (m_s, m_t, 3) or (m_s, 2), of control points likewise.
_Pair = tuple[np.ndarray, np.ndarray]


def plot_control_net(
    design: DesignSurface,
    points: tuple[np.ndarray, np.ndarray],
    net: tuple[np.ndarray, np.ndarray],
    path: str | Path | None = None,
    *,
    clim: tuple[float, float] | None = None,
    magnify: float | None = None,
    title: str = "",
    units: Units | None = None,
    width: int = 1600,
    comm: MPI.Comm | None = None,
) -> Picture:
    """Draw the design surface with its control net before and after, coloured by its outward movement.

    The curve of a plane body is drawn with its control points, before in grey and after in colours.

    Args:
        design: Nodes of the surface, their order and outward normals.
        points: The body's nodes before and after, (n_nodes, 3 | 2) each, [length].
        net: Control points before and after, (n_s, n_t, 3) or in the plane (n_s, 2) each, [length].
        path: PNG file to write, None to write none.
        clim: Range of the colours, [length]; symmetric about zero unless given.
        magnify: Factor of the movement in the picture of after; chosen and stated unless given.
        title: Text before the facts in the title.
        units: Names of the units, mm, N and MPa unless given.
        width: Width of the picture in pixels.
        comm: If given, only rank 0 draws, and an error is raised on all ranks.

    Returns:
        The picture, which can be used like a path to its file.

    Raises:
        InvalidInputError: If arrays are inconsistent or not finite, or an option cannot be used.
        MissingRequirementError: If this machine cannot render.

    Note:
        Collective on ``comm`` if given.
    """
    target, dim = png_path(path), design.directions.shape[1]
    points = _checked("points", points, ("n_nodes",), dim)
    net = _checked("net", net, ("n_s", "n_t")[: dim - 1], dim)
    if magnify is not None and not np.isfinite(magnify):
        raise InvalidInputError(
            f"magnify must be finite, got {magnify}: give the factor of the movement, such as 5"
        )
    start, movement = points[0][design.nodes], (points[1] - points[0])[design.nodes]
    outward = np.einsum("nd,nd->n", movement, design.directions)
    largest = float(np.abs(outward).max()) or 1.0
    shown, named = (-largest, largest) if clim is None else checked_range(clim), units or Units()
    factor = _chosen_factor(start, movement) if magnify is None else float(magnify)
    shape = (*design.counts, dim)
    surfaces = start.reshape(shape), (start + factor * movement).reshape(shape)
    nets = net[0], net[0] + factor * (net[1] - net[0])
    low, high = (written(float(value), 3) for value in (outward.min(), outward.max()))
    words = headline(title, f"surface moved by {low} to {high} {named.length} along its outward normal")
    after = f"after, movement × {factor:g}"

    def draw(paper: BinaryIO) -> None:
        parts, height = _parts(surfaces, nets, outward, shown, width) if dim == 3 else ([], _height(surfaces))
        with sheet(paper, (width, round(height * width)), words) as figure:
            panels = figure.subplots(1, 2 if dim == 3 else 1, squeeze=False)[0]
            for axes, (image, frame), name in zip(panels, parts, ("before", after), strict=False):
                show_image(axes, image, frame, name)
            if dim == 2:
                _draw_curve(panels[0], surfaces, nets, outward, shown)
                panels[0].set(title=f"before in grey, {after}")
                panels[0].set(xlabel=f"x ({named.length})", ylabel=f"y ({named.length})")
            key = ScalarMappable(Normalize(*shown), SIGNED_MAP)
            add_colour_bar(figure, panels, key, f"outward movement ({named.length})")

    return draw_picture(comm, target, draw)


def _checked(name: str, given: _Pair, counts: tuple[str, ...], dim: int) -> _Pair:
    before, after = (np.asarray(values, dtype=float) for values in given)
    for number, array in enumerate((before, after)):
        if array.ndim != len(counts) + 1 or array.shape[-1] != dim:
            raise InvalidInputError(
                f"{name}[{number}] must have shape ({', '.join(counts)}, {dim}), got {array.shape}: pass "
                "coordinates"
            )
        if not np.all(np.isfinite(array)):
            raise InvalidInputError(f"{name}[{number}] must be finite, got NaN or infinity: check the design")
    if before.shape != after.shape:
        raise InvalidInputError(
            f"before and after must have the same shapes, got {name} {before.shape} and {after.shape}: take "
            "both from the same design"
        )
    return before, after


def _chosen_factor(start: np.ndarray, movement: np.ndarray) -> float:
    moved = float(np.linalg.norm(movement, axis=1).max())
    return max(1.0, nice_number(VISIBLE * float(np.ptp(start, axis=0).max()) / moved)) if moved > 0 else 1.0


def _height(curves: _Pair) -> float:
    """Return the height of the picture of a curve relative to its width."""
    size = np.ptp(np.concatenate(curves), axis=0)
    return 0.1 + float(np.clip(0.9 * size[1] / max(size[0], 1e-300), 0.2, 0.9))


def _draw_curve(
    axes: Axes, curves: _Pair, nets: _Pair, outward: np.ndarray, clim: tuple[float, float]
) -> None:
    """Draw a curve and its control points before, in grey, and after, coloured by the outward movement."""
    axes.plot(*curves[0].T, color=GREY, linewidth=1.5)
    axes.plot(*nets[0].T, "o", color=GREY, markersize=6)
    pieces = np.stack([curves[1][:-1], curves[1][1:]], axis=1)
    look = {"cmap": SIGNED_MAP, "norm": Normalize(*clim), "linewidths": 4.0, "capstyle": "round"}
    axes.add_collection(LineCollection(pieces, colors=INK, linewidths=5.0, capstyle="round"))
    axes.add_collection(LineCollection(pieces, array=(outward[1:] + outward[:-1]) / 2, **look))
    axes.plot(*nets[1].T, "o--", color=ORANGE, markersize=10, linewidth=1.0)
    axes.set_aspect("equal", adjustable="datalim")


def _parts(
    surfaces: _Pair, nets: _Pair, outward: np.ndarray, clim: tuple[float, float], width: int
) -> tuple[list[tuple[np.ndarray, Frame]], float]:
    """Return images of surface and net before and after, and the height of the picture to its width."""
    start, end = surfaces
    view = _view(start)
    frame = frame_around(view, np.concatenate([x.reshape(-1, 3) for x in (*surfaces, *nets)]), 0.05)
    before = [_surface_layer(start, 0.0 * outward, clim), *_net_layers(start, nets[0], ORANGE, 1.0)]
    after = [_surface_layer(end, outward, clim), *_net_layers(start, nets[0], GREY, 0.5)]
    after += _net_layers(start, nets[1], ORANGE, 1.0)
    images = [(render(layers, view, frame, round(PART * width)), frame) for layers in (before, after)]
    return images, 0.09 + PART / frame.proportion


def _view(grid: np.ndarray) -> View:
    """Look obliquely at the middle of the surface from outside, with s to the right."""
    along = grid[-1].mean(axis=0) - grid[0].mean(axis=0)
    across = grid[:, -1].mean(axis=0) - grid[:, 0].mean(axis=0)
    along, across = along / np.linalg.norm(along), across / np.linalg.norm(across)
    return looking_along(np.cross(along, across) - 0.2 * along - 0.5 * across, along)


def _surface_layer(grid: np.ndarray, moved: np.ndarray, clim: tuple[float, float]) -> Layer:
    mesh = pv.StructuredGrid(*np.moveaxis(grid, -1, 0)[..., None])
    mesh.point_data["moved"] = moved.reshape(grid.shape[:2]).ravel(order="F")
    look = {"scalars": "moved", "cmap": SIGNED_MAP, "clim": clim, "opacity": OPACITY}
    edges = {"show_edges": True, "edge_color": INK, "edge_opacity": 0.25, "line_width": 1}
    return Layer(mesh, {**look, **edges, "ambient": 0.55, "diffuse": 0.45, "smooth_shading": True})


def _net_layers(grid: np.ndarray, net: np.ndarray, colour: str, thickness: float) -> list[Layer]:
    look = {"color": colour, "ambient": 0.5, "diffuse": 0.6}
    size = float(np.ptp(grid.reshape(-1, 3), axis=0).max())
    tubes = [pv.lines_from_points(bar).tube(radius=0.005 * thickness * size) for bar in _bars(grid, net)]
    points = balls(net.reshape(-1, 3), 0.014 * thickness * size)
    return [Layer(mesh, look) for mesh in (*tubes, points)]


def _bars(grid: np.ndarray, net: np.ndarray) -> list[np.ndarray]:
    """Return the bars of a net as polylines that follow the surface instead of cutting through it.

    Control point (i, j) belongs to the surface's parameters (i / (n_s - 1), j / (n_t - 1)). The offset of a
    bar from the surface is linear along the bar, so that it ends at its control points.
    """
    fine = [np.linspace(0, count - 1, PIECES * (count - 1) + 1) for count in net.shape[:2]]
    stations = zip(fine, net.shape[:2], grid.shape[:2], strict=True)
    rows, columns = (_hats(_parameters(x, count) * (nodes - 1), nodes) for x, count, nodes in stations)
    surface = np.einsum("ri,cj,ijd->rcd", rows, columns, grid)
    rows, columns = (_hats(x, count) for x, count in zip(fine, net.shape[:2], strict=True))
    points = surface + np.einsum("ri,cj,ijd->rcd", rows, columns, net - surface[::PIECES, ::PIECES])
    bars = [*points[::PIECES], *np.swapaxes(points, 0, 1)[::PIECES]]
    return [bar for bar in bars if len(bar) > 1]


def _parameters(places: np.ndarray, count: int) -> np.ndarray:
    """Return the surface's parameters of control points; a single one lies in the middle."""
    return places / (count - 1) if count > 1 else np.full(len(places), 0.5)


def _hats(places: np.ndarray, count: int) -> np.ndarray:
    """Return the piecewise linear hat functions of 0 .. count - 1 at some points, (n, count)."""
    return np.maximum(0.0, 1.0 - np.abs(places[:, None] - np.arange(count)))
