"""Picture of a design surface and its control net, before and after."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, BinaryIO

import numpy as np
import pyvista as pv
from matplotlib.cm import ScalarMappable
from matplotlib.colors import Normalize

from fenics_contact.errors import InvalidInputError
from fenics_contact.gallery import DesignSurface
from fenics_contact.viz.colours import GREY, INK, ORANGE, SIGNED_MAP
from fenics_contact.viz.control_curve import draw_control_curve
from fenics_contact.viz.curved_net import curved_net
from fenics_contact.viz.picture import Picture, draw_picture, png_path
from fenics_contact.viz.sheet import add_colour_bar, sheet, show_image
from fenics_contact.viz.stage import Layer, balls, render
from fenics_contact.viz.units import Units
from fenics_contact.viz.view import View, frame_around, looking_along
from fenics_contact.viz.words import checked_range, headline, nice_number, written

if TYPE_CHECKING:
    from mpi4py import MPI

#: Apparent size of the largest movement relative to the surface.
VISIBLE = 0.06
#: Opacity of the surface.
OPACITY = 0.75
#: Fraction of the width for each of the two pictures.
PART = 0.45


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
    target = png_path(path)
    dim = design.directions.shape[1]
    before, after = (_checked(f"points[{number}]", x, ("n_nodes",), dim) for number, x in enumerate(points))
    nets = [_checked(f"net[{number}]", x, ("n_s", "n_t")[: dim - 1], dim) for number, x in enumerate(net)]
    if before.shape != after.shape or nets[0].shape != nets[1].shape:
        raise InvalidInputError(
            f"before and after must have the same shapes, got points {before.shape} and {after.shape}, nets "
            f"{nets[0].shape} and {nets[1].shape}: take both from the same design"
        )
    if magnify is not None and not np.isfinite(magnify):
        raise InvalidInputError(
            f"magnify must be finite, got {magnify}: give the factor of the movement, such as 5"
        )
    start, movement = before[design.nodes], (after - before)[design.nodes]
    outward = np.einsum("nd,nd->n", movement, design.directions)
    largest = float(np.abs(outward).max()) or 1.0
    factor = _chosen_factor(start, movement) if magnify is None else float(magnify)
    shown = (-largest, largest) if clim is None else checked_range(clim)
    surfaces = (x.reshape(*design.counts, dim) for x in (start, start + factor * movement))
    ends = nets[0], nets[0] + factor * (nets[1] - nets[0])
    change = _Change(tuple(surfaces), ends, outward, factor, shown)
    return draw_picture(comm, target, lambda paper: _draw(change, paper, title, units or Units(), width))


def _checked(name: str, values: np.ndarray, counts: tuple[str, ...], dim: int) -> np.ndarray:
    array = np.asarray(values, dtype=float)
    if array.ndim != len(counts) + 1 or array.shape[-1] != dim:
        wanted = f"({', '.join(counts)}, {dim})"
        raise InvalidInputError(f"{name} must have shape {wanted}, got {array.shape}: pass coordinates")
    if not np.all(np.isfinite(array)):
        raise InvalidInputError(f"{name} must be finite, got NaN or infinity: check the design")
    return array


def _chosen_factor(start: np.ndarray, movement: np.ndarray) -> float:
    moved = float(np.linalg.norm(movement, axis=1).max())
    return max(1.0, nice_number(VISIBLE * float(np.ptp(start, axis=0).max()) / moved)) if moved > 0 else 1.0


@dataclass(frozen=True)
class _Change:
    """Surface (m_s, m_t, 3) and net (n_s, n_t, 3), or curve (m_s, 2) and net (n_s, 2)."""

    surfaces: tuple[np.ndarray, np.ndarray]
    nets: tuple[np.ndarray, np.ndarray]
    outward: np.ndarray
    factor: float
    clim: tuple[float, float]


def _draw(change: _Change, paper: BinaryIO, title: str, units: Units, width: int) -> None:
    low, high = (written(float(value), 3) for value in (change.outward.min(), change.outward.max()))
    words = headline(title, f"surface moved by {low} to {high} {units.length} along its outward normal")
    shown = f"after, movement × {change.factor:g}"
    (start, end), (net, end_net) = change.surfaces, change.nets
    if start.shape[-1] == 2:
        named = words, f"before in grey, {shown}", units.length
        draw_control_curve(change.surfaces, change.nets, change.outward, change.clim, named, width, paper)
        return
    view = _view(start)
    frame = frame_around(view, np.concatenate([x.reshape(-1, 3) for x in (start, end, net, end_net)]), 0.05)
    before = [_surface_layer(start, 0.0 * change.outward, change.clim), *_net_layers(start, net, ORANGE, 1.0)]
    ghost, after = _net_layers(start, net, GREY, 0.5), _surface_layer(end, change.outward, change.clim)
    parts = {
        "before": before,
        shown: [after, *ghost, *_net_layers(start, end_net, ORANGE, 1.0)],
    }
    with sheet(paper, (width, round((0.09 + PART / frame.proportion) * width)), words) as figure:
        panels = figure.subplots(1, 2)
        for axes, (name, layers) in zip(panels, parts.items(), strict=True):
            show_image(axes, render(layers, view, frame, round(PART * width)), frame, name)
        key = ScalarMappable(Normalize(*change.clim), SIGNED_MAP)
        add_colour_bar(figure, panels, key, f"outward movement ({units.length})")


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
    points, edges = curved_net(grid, net)
    bars = pv.PolyData(points, lines=np.insert(edges, 0, 2, axis=1).ravel())
    return [
        Layer(bars.tube(radius=0.005 * thickness * size), look),
        Layer(balls(net.reshape(-1, 3), 0.014 * thickness * size), look),
    ]
