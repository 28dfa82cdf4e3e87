"""Picture of a design surface and its control net, before and after."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np

from fenics_contact.errors import InvalidInputError
from fenics_contact.geometry import DesignSurface
from fenics_contact.viz.colours import GREY, INK, ORANGE, SIGNED_MAP
from fenics_contact.viz.sheet import TITLE, draw_on_one_rank, place_colour_bar, place_image, png_path, sheet
from fenics_contact.viz.stage import Layer, balls, render, surface, tubes
from fenics_contact.viz.units import Units
from fenics_contact.viz.view import Frame, View, frame_around, looking_along
from fenics_contact.viz.words import checked_range, headline, nice_number, written

if TYPE_CHECKING:
    from mpi4py import MPI

#: Fraction of the surface's size that the largest movement appears to have.
VISIBLE = 0.06
#: How much of what lies behind it the surface hides.
OPACITY = 0.75
#: Straight pieces between two control points.
BARS = 8
#: Part of the width that each of the two pictures takes.
PART = 0.45


def plot_control_net(
    design: DesignSurface,
    points: tuple[np.ndarray, np.ndarray],
    net: tuple[np.ndarray, np.ndarray],
    path: str | Path,
    *,
    clim: tuple[float, float] | None = None,
    magnify: float | None = None,
    title: str = "",
    units: Units | None = None,
    width: int = 1600,
    comm: MPI.Comm | None = None,
) -> Path:
    """Draw the design surface with its control net before and after, coloured by how far it moved outwards.

    Args:
        design: Nodes of the surface, their order and outward normals.
        points: The body's nodes before and after, (n_nodes, 3) each, [length].
        net: Control points before and after, (n_s, n_t, 3) each, [length].
        path: PNG file to write.
        clim: Range of the colours, [length]; symmetric about zero unless given.
        magnify: Factor of the movement in the right picture; chosen and stated unless given.
        title: What comes before the facts in the title.
        units: Names of the units, mm, N and MPa unless given.
        width: Width of the picture in pixels.
        comm: If given, only rank 0 draws, and all ranks learn of an error.

    Returns:
        The path.

    Raises:
        InvalidInputError: If arrays do not fit each other, are not finite, or an option cannot be used.
        MissingRequirementError: If this machine cannot render.

    Note:
        Collective on ``comm`` if given.
    """
    target = png_path(path)
    before, after = (_finite(f"points[{i}]", x)[design.nodes] for i, x in enumerate(points))
    nets = tuple(_finite(f"net[{i}]", x) for i, x in enumerate(net))
    if nets[0].ndim != 3 or nets[0].shape != nets[1].shape or nets[0].shape[-1] != 3:
        raise InvalidInputError(
            f"both nets must have the same shape (n_s, n_t, 3), got {nets[0].shape} and {nets[1].shape}: pass the "
            "control points as a grid"
        )
    if magnify is not None and not np.isfinite(magnify):
        raise InvalidInputError(
            f"magnify must be finite, got {magnify}: give the factor of the movement, such as 5"
        )
    outward = np.einsum("nd,nd->n", after - before, design.directions)
    largest = float(np.abs(outward).max()) or 1.0
    factor = _chosen_factor(before, after) if magnify is None else magnify
    shown = (-largest, largest) if clim is None else checked_range(clim)
    change = _Change(
        design.counts, before, after - before, outward, nets[0], nets[1] - nets[0], factor, shown
    )
    draw_on_one_rank(comm, lambda: _draw(change, target, title, units or Units(), width))
    return target


def _finite(name: str, values: np.ndarray) -> np.ndarray:
    array = np.asarray(values, dtype=float)
    if not np.all(np.isfinite(array)):
        raise InvalidInputError(f"{name} must be finite, got NaN or infinity: check the design")
    return array


def _chosen_factor(before: np.ndarray, after: np.ndarray) -> float:
    moved = float(np.linalg.norm(after - before, axis=1).max())
    return max(1.0, nice_number(VISIBLE * float(np.ptp(before, axis=0).max()) / moved)) if moved > 0 else 1.0


@dataclass(frozen=True)
class _Change:
    counts: tuple[int, int]
    start: np.ndarray
    movement: np.ndarray
    outward: np.ndarray
    net: np.ndarray
    net_movement: np.ndarray
    factor: float
    clim: tuple[float, float]


def _draw(change: _Change, target: Path, title: str, units: Units, width: int) -> None:
    view = _view(change)
    ends = [change.start, change.start + change.factor * change.movement]
    nets = [change.net, change.net + change.factor * change.net_movement]
    frame = frame_around(view, np.concatenate([*ends, *(net.reshape(-1, 3) for net in nets)]), 0.05)
    size = round(PART * width)
    before = _seen_through(
        _surface_layer(change, ends[0], False), _nets(change, nets[0], False), view, frame, size
    )
    after = _seen_through(
        _surface_layer(change, ends[1], True), _nets(change, nets[1], True), view, frame, size
    )
    low, high = (written(float(value), 3) for value in (change.outward.min(), change.outward.max()))
    facts = f"surface moved by {low} to {high} {units.length} along its outward normal"
    top = round((TITLE + 0.03) * width)
    with sheet(
        target, (width, top + before.shape[0] + round(0.01 * width)), headline(title, facts)
    ) as figure:
        place_image(figure, before, 0, top, "before")
        place_image(figure, after, size, top, f"after, movement × {change.factor:g}")
        label = f"outward movement ({units.length})"
        place_colour_bar(figure, (2 * size, top, before.shape[0]), SIGNED_MAP, change.clim, label)


def _view(change: _Change) -> View:
    """Look onto the middle of the surface from its outside, aslant, s running to the right."""
    grid = change.start.reshape(*change.counts, 3)
    along, across = (
        grid[-1].mean(axis=0) - grid[0].mean(axis=0),
        grid[:, -1].mean(axis=0) - grid[:, 0].mean(axis=0),
    )
    size = float(np.linalg.norm(along))
    outside = np.cross(along, across) / (size * np.linalg.norm(across))
    return looking_along(outside - 0.2 * along / size - 0.5 * across / np.linalg.norm(across), along)


def _seen_through(body: Layer, net: list[Layer], view: View, frame: Frame, width: int) -> np.ndarray:
    """Draw a net on a surface that hides only part of what is behind it, without asking OpenGL to blend."""
    full, net_only = render([body, *net], view, frame, width), render(net, view, frame, width)
    return np.asarray((OPACITY * full + (1 - OPACITY) * net_only).round(), dtype=np.uint8)


def _surface_layer(change: _Change, points: np.ndarray, moved: bool) -> Layer:
    mesh = surface(points, _grid_faces(change.counts))
    mesh.point_data["moved"] = change.outward if moved else np.zeros(len(points))
    look = {"scalars": "moved", "cmap": SIGNED_MAP, "clim": change.clim, "ambient": 0.55, "diffuse": 0.45}
    edges = {"show_edges": True, "edge_color": INK, "edge_opacity": 0.25, "line_width": 1}
    return Layer(mesh, {**look, **edges, "smooth_shading": True})


def _nets(change: _Change, net: np.ndarray, moved: bool) -> list[Layer]:
    ghost = _net_layers(change, change.net, GREY, 0.5) if moved else []
    return [*ghost, *_net_layers(change, net, ORANGE, 1.0)]


def _net_layers(change: _Change, net: np.ndarray, colour: str, thickness: float) -> list[Layer]:
    size = float(np.ptp(change.start, axis=0).max())
    look = {"color": colour, "ambient": 0.5, "diffuse": 0.6}
    points, edges = _curved_net(change, net)
    return [
        Layer(tubes(points, edges, 0.005 * thickness * size), look),
        Layer(balls(net.reshape(-1, 3), 0.014 * thickness * size), look),
    ]


def _curved_net(change: _Change, net: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Return the net's bars as polylines that follow the surface instead of cutting through it.

    What is added to the surface's own points is linear along each bar, so that it ends at its control points.
    """
    fine = [np.linspace(0, n - 1, BARS * (n - 1) + 1) if n > 1 else np.zeros(1) for n in net.shape[:2]]
    shape = tuple(len(f) for f in fine)
    grid = change.start.reshape(*change.counts, 3)
    at = [f / max(n - 1, 1) * (m - 1) for f, n, m in zip(fine, net.shape[:2], change.counts, strict=True)]
    coarse = [
        np.linspace(0, m - 1, n) if n > 1 else np.zeros(1)
        for n, m in zip(net.shape[:2], change.counts, strict=True)
    ]
    base = bilinear(grid, *at)
    points = base + bilinear(net - bilinear(grid, *coarse), *fine)
    number = np.arange(shape[0] * shape[1]).reshape(shape)
    along, across = number[:, ::BARS], number[::BARS]
    edges = [np.stack([along[:-1], along[1:]], axis=-1), np.stack([across[:, :-1], across[:, 1:]], axis=-1)]
    return points.reshape(-1, 3), np.concatenate([edge.reshape(-1, 2) for edge in edges])


def bilinear(grid: np.ndarray, rows: np.ndarray, columns: np.ndarray) -> np.ndarray:
    """Interpolate a grid (m, n, 3) at all pairs of fractional row and column numbers, (r, c, 3)."""
    i, j = (
        np.minimum(x.astype(int), max(n - 2, 0)) for x, n in ((rows, grid.shape[0]), (columns, grid.shape[1]))
    )
    a, b = (rows - i)[:, None, None], (columns - j)[None, :, None]
    below, beside = np.minimum(i + 1, grid.shape[0] - 1), np.minimum(j + 1, grid.shape[1] - 1)
    first = (1 - b) * grid[np.ix_(i, j)] + b * grid[np.ix_(i, beside)]
    second = (1 - b) * grid[np.ix_(below, j)] + b * grid[np.ix_(below, beside)]
    return np.asarray((1 - a) * first + a * second)


def _grid_faces(counts: tuple[int, int]) -> np.ndarray:
    number = np.arange(counts[0] * counts[1]).reshape(counts)
    corners = (number[:-1, :-1], number[1:, :-1], number[1:, 1:], number[:-1, 1:])
    return np.stack(corners, axis=-1).reshape(-1, 4)
