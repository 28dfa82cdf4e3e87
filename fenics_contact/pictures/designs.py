"""Pictures of designs: contact before and after, the control net, the objective by evaluation."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from typing import TYPE_CHECKING, BinaryIO

import numpy as np
import pyvista as pv
from matplotlib.axes import Axes
from matplotlib.cm import ScalarMappable
from matplotlib.collections import LineCollection
from matplotlib.colors import Normalize
from matplotlib.figure import Figure
from matplotlib.ticker import MaxNLocator
from scipy.spatial import cKDTree

from fenics_contact._base.checks import naming_arguments
from fenics_contact._optimize.result import Record
from fenics_contact.design.memory import DesignPoint
from fenics_contact.errors import InvalidInputError
from fenics_contact.pictures.canvas import (
    BLUE,
    GREY,
    IN_PLANE,
    INK,
    ORANGE,
    SIGNED_MAP,
    Frame,
    Layer,
    Picture,
    Units,
    View,
    add_colour_bar,
    balls,
    change,
    checked_factor,
    checked_range,
    checked_reach,
    draw_picture,
    frame_around,
    headline,
    looking_along,
    nice_number,
    oblique_view,
    png_path,
    render,
    sheet,
    show_view,
    written,
)
from fenics_contact.pictures.curves import contact_trace
from fenics_contact.pictures.drawing import REACH
from fenics_contact.pictures.section import cut, points_of, section_frame, sections_of, strongest_contact
from fenics_contact.pictures.states import draw_pressure
from fenics_contact.pictures.unrolled import (
    checked_pair,
    contact_patches,
    label_axes,
    label_patch,
    pressure_bar,
)
from fenics_contact.results.fields import in_space
from fenics_contact.results.multi_block import body_grid
from fenics_contact.results.state import State

if TYPE_CHECKING:
    from mpi4py import MPI

    from fenics_contact.design.problem import ShapeProblem
    from fenics_contact.design.several import JointProblem


#: Apparent size of the largest movement relative to the picture.
VISIBLE = 0.06
#: Margin around the bodies, relative to their size.
BORDER = 0.08


@naming_arguments
def plot_before_after(
    first: State | DesignPoint,
    best: State | DesignPoint,
    path: str | Path | None = None,
    *,
    pair: int = 0,
    clim: tuple[float, float] | None = None,
    reach: float | None = None,
    label: str = "objective",
    title: str = "",
    units: Units | None = None,
    width: int = 1600,
) -> Picture:
    """Draw contact pressure before and after in the same colours, and the movement of outlines. Collective.

    The outlines are those of the undeformed bodies around the strongest contact: in space in two sections, in
    the plane directly; those after in true scale, and with their movement magnified by a stated factor. The
    title reports the decrease of the objective, if design points are given, and by how much the seat of the
    slave receded: the distance that the unloaded slave may travel along its contact force until it touches.

    Args:
        first: State before, or the design point, for instance ``problem.first``.
        best: State after, or the design point, for instance ``problem.best``.
        pair: Number of the contact pair in the scene.
        clim: Range of the pressure, [force / length²]; from zero to the largest of both unless given.
        reach: How far pictures reach around the contact's middle, [length]; chosen unless given.
        label: Name of the objective with its unit.

    Raises:
        InvalidInputError: If the two do not belong to the same scene, it has no such pair, nothing touches
            before, or an option cannot be used.
    """
    target = png_path(path)
    states = [point.state if isinstance(point, DesignPoint) else point for point in (first, best)]
    before, after = states
    _check(before, after, pair)
    around, given = checked_reach(reach), checked_range(clim)
    named, plane = units or Units(), before.scene.dim == 2
    peaks = [float(state.contact.pressure[state.contact.on_pair(pair)].max(initial=0.0)) for state in states]
    values = [each.value for each in (first, best) if isinstance(each, DesignPoint)]
    facts = [f"{label} {change(*values)}"] if len(values) == 2 else []
    if len(values) < 2 or not np.allclose(values, peaks, rtol=1e-6):
        facts.append(f"largest pressure {written(peaks[0])} → {written(peaks[1])} {named.stress}")
    facts.append(f"seat gives way by {written(_retreat(before, after, pair), 2)} {named.length}")
    shown, words = given or (0.0, max(peaks) or 1.0), headline(title, "; ".join(facts))

    def draw(paper: BinaryIO) -> None:
        outlines = _outlines(before, after, around, named.length)
        with sheet(paper, (width, round((0.5 if plane else 0.95) * width)), words) as figure:
            if plane:
                left, *panels = figure.subplots(1, 2)
                _draw_traces(left, states, pair, shown, around, named)
            else:
                upper, lower = figure.subfigures(2, 1, height_ratios=[0.48, 0.47])
                _draw_patches(upper, states, pair, shown, around, named)
                panels = list(lower.subplots(1, 2, width_ratios=[each.frame.proportion for each in outlines]))
            for axes, outline in zip(panels, outlines, strict=True):
                outline.draw(axes, min(each.factor for each in outlines), named)
            lines = panels[0].get_legend_handles_labels()
            figure.legend(*lines, loc="outside lower center", ncols=3)

    return draw_picture(before.torn.decomposition.comm, target, draw)


def _retreat(first: State, best: State, pair: int) -> float:
    """Return how much farther the slave may travel against the contact force; 0 where it is rounding."""
    resultant = first.contact.force[first.contact.on_pair(pair)].sum(axis=0)
    way = -resultant / np.linalg.norm(resultant)
    found = best.contact.travel(way, pair) - first.contact.travel(way, pair)
    return 0.0 if abs(found) < 1e-9 * float(np.ptp(first.scene.points)) else found


def _check(first: State, best: State, pair: int) -> None:
    cells = [
        {name: body.mesh.cells.shape for name, body in state.scene.deforming.items()}
        for state in (first, best)
    ]
    if cells[0] != cells[1]:
        raise InvalidInputError(
            f"before and after must have the same bodies and cells, got {cells[0]} and {cells[1]}"
        )
    checked_pair(first, pair)
    if not np.any(first.contact.normal_force > 0):
        raise InvalidInputError("before needs contact forces, got none: draw with plot_stress")


def _draw_patches(
    figure: Figure,
    states: list[State],
    pair: int,
    clim: tuple[float, float],
    reach: float,
    units: Units,
) -> None:
    """Draw the pressure before and after side by side in one frame."""
    patches = contact_patches(states, pair, reach)
    low, high = ([getattr(patch.frame, end) for patch in patches] for end in ("low", "high"))
    frame = Frame(np.min(low, axis=0), np.max(high, axis=0))
    panels = figure.subplots(1, 2)
    for axes, patch, word in zip(panels, patches, ("before", "after"), strict=True):
        draw_pressure(axes, patch, clim)
        axes.set_title(f"{word}: pressure on {patch.name}{patch.behind}")
        label_patch(axes, replace(patch, frame=frame), units)
    beyond = max(float(patch.pressure.max()) for patch in patches) > clim[1]
    pressure_bar(panels[1], clim, "max" if beyond else "neither", units)


def _draw_traces(
    axes: Axes,
    states: list[State],
    pair: int,
    clim: tuple[float, float],
    reach: float,
    units: Units,
) -> None:
    """Draw the pressure along a plane surface before and after."""
    traces = [contact_trace(state, pair) for state in states]
    looks = ({"ls": "--", "color": GREY, "label": "before"}, {"color": ORANGE, "label": "after"})
    for trace, look in zip(traces, looks, strict=True):
        axes.plot(trace.broken(trace.places), trace.broken(trace.pressure), lw=2.2, **look)
    ends, room = [end for trace in traces for end in trace.window(reach)], clim[1] - clim[0]
    axes.set(xlim=(min(ends), max(ends)), ylim=(clim[0] - 0.03 * room, clim[1] + 0.08 * room))
    axes.set(xlabel=f"{traces[0].axis} ({units.length})", ylabel=f"contact pressure ({units.stress})")
    axes.set_title(f"pressure on {traces[0].name}")
    axes.grid(color=GREY, alpha=0.25)
    axes.legend(loc="upper right")


@dataclass(frozen=True)
class _Outlines:
    """Outlines of bodies in a view: lines before, (n, 2 ends, 2), how their ends move, points within."""

    title: str
    view: View
    frame: Frame
    before: dict[str, np.ndarray]
    moves: dict[str, np.ndarray]
    inside: dict[str, np.ndarray]

    @property
    def largest(self) -> float:
        """Largest visible movement, [length]."""
        seen = {name: self.frame.holds(lines).all(axis=1) for name, lines in self.before.items()}
        parts = [np.linalg.norm(self.moves[name][here], axis=-1).ravel() for name, here in seen.items()]
        return float(np.concatenate(parts).max(initial=0.0))

    @property
    def factor(self) -> float:
        """Round factor, at least 1, that makes the movement visible."""
        size = float(np.max(self.frame.size))
        return max(1.0, nice_number(VISIBLE * size / self.largest)) if self.largest > 0 else 1.0

    def draw(self, axes: Axes, factor: float, units: Units) -> None:
        """Draw the outlines before and after, the movement also magnified, and the bodies' names."""
        drawn = [("before", 0.0, GREY, 3.5), (f"after, movement × {factor:g}", factor, ORANGE, 1.6)]
        drawn += [("after", 1.0, INK, 0.8)] if factor > 1.0 else []
        room = cKDTree(np.concatenate([lines.reshape(-1, 2) for lines in self.before.values()]))
        for number, (name, lines) in enumerate(self.before.items()):
            for word, by, colour, width in drawn:
                moved, label = lines + by * self.moves[name], None if number else word
                axes.add_collection(LineCollection(moved, colors=colour, linewidths=width, label=label))
            places = self.inside[name][self.frame.holds(self.inside[name])]
            if len(places):  # the name, far from all lines and from the border
                border = np.minimum(places - self.frame.low, self.frame.high - places).min(axis=1)
                place = places[np.argmax(np.minimum(room.query(places)[0], border))]
                axes.text(*place, name, color=BLUE, ha="center", va="center")
        self.frame.fit(axes)
        label_axes(axes, self.view, units)
        axes.set_title(f"{self.title}\nmoved by up to {written(self.largest, 2)} {units.length}")


def _outlines(first: State, best: State, reach: float, unit: str) -> list[_Outlines]:
    """Return the outlines around the strongest contact before: in the plane one, in space two sections."""
    bodies: dict[str, pv.DataSet] = {}
    for name, body in first.scene.deforming.items():
        bodies[name] = body_grid(body.mesh.linear, in_space(body.mesh.points))
        bodies[name].point_data["moves"] = in_space(best.scene.bodies[name].mesh.points - body.mesh.points)
    spot, points = strongest_contact(first.contact, first.contact_places), points_of(bodies)
    if first.scene.dim == 2:
        half, whole = reach or REACH * spot.radius, frame_around(IN_PLANE, points, BORDER)
        frame = Frame(np.maximum(spot.centre - half, whole.low), np.minimum(spot.centre + half, whole.high))
        return [_outlined("outlines", bodies, IN_PLANE, frame)]
    outlines = []
    for section in sections_of(spot, oblique_view(points)):
        frame = section_frame(section.view, spot, points, reach)
        outlines.append(_outlined(section.title(frame, unit), cut(bodies, section), section.view, frame))
    return outlines


def _outlined(title: str, faces: dict[str, pv.DataSet], view: View, frame: Frame) -> _Outlines:
    """Return the outlines of plane faces, how they move, and the middles of their cells."""
    before, moves, inside = {}, {}, {}
    for name, face in faces.items():
        edge = face.extract_feature_edges(feature_edges=False, manifold_edges=False)
        ends = edge.lines.reshape(-1, 3)[:, 1:] if edge.n_cells else np.zeros((0, 2), dtype=int)
        before[name] = view.project(np.asarray(edge.points))[ends]
        moves[name] = view.project(np.asarray(edge["moves"]))[ends] if len(ends) else before[name]
        inside[name] = view.project(np.asarray(face.cell_centers().points))
    return _Outlines(title, view, frame, before, moves, inside)


#: Opacity of the surface.
OPACITY = 0.75
#: Fraction of the width for each of the two pictures.
PART = 0.45

#: Before and after: of nodes in their order, (m_s, m_t, 3) or (m_s, 2), of control points likewise.
_Pair = tuple[np.ndarray, np.ndarray]


@naming_arguments
def plot_control_net(
    problem: ShapeProblem | JointProblem,
    alpha: np.ndarray,
    path: str | Path | None = None,
    *,
    design: int = 0,
    clim: tuple[float, float] | None = None,
    magnify: float | None = None,
    title: str = "",
    units: Units | None = None,
    width: int = 1600,
) -> Picture:
    """Draw a designed surface with its control net, coloured by its outward movement. Collective.

    The curve of a plane body is drawn with its control points, before in grey and after in colours.

    Args:
        problem: The problem with the design.
        alpha: Design variables of all its designs, shape (size,), [length]: ``result.x``.
        design: Number of the design among ``problem.designs``.
        clim: Range of the colours, [length]; symmetric about zero unless given.
        magnify: Factor of the movement in the picture of after; chosen and stated unless given.

    Raises:
        InvalidInputError: If there is no such design, alpha does not fit, or an option cannot be used.
    """
    target = png_path(path)
    if design not in range(len(problem.designs)):
        raise InvalidInputError(
            f"there are {len(problem.designs)} designs, got number {design}: count from 0"
        )
    one, ends = problem.designs[design], np.cumsum([each.size for each in problem.designs])
    reference, moved = problem.scene.bodies[one.body].mesh.points, problem.points_of(alpha)[one.body]
    part, surface, dim = np.split(np.asarray(alpha), ends[:-1])[design], one.lattice, reference.shape[1]
    net = one.control_points(reference, 0.0 * part), one.control_points(reference, part)
    start, movement = reference[surface.nodes], (moved - reference)[surface.nodes]
    outward = np.einsum("nd,nd->n", movement, surface.directions)
    largest = float(np.abs(outward).max()) or 1.0
    shown, named = checked_range(clim) or (-largest, largest), units or Units()
    factor = _chosen_factor(start, movement) if magnify is None else checked_factor("magnify", magnify)
    shape = (*surface.counts, dim)
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
                show_view(axes, image, frame, name)
            if dim == 2:
                _draw_curve(panels[0], surfaces, nets, outward, shown)
                panels[0].set(title=f"before in grey, {after}")
                panels[0].set(xlabel=f"x ({named.length})", ylabel=f"y ({named.length})")
            key = ScalarMappable(Normalize(*shown), SIGNED_MAP)
            add_colour_bar(figure, panels, key, f"outward movement ({named.length})")

    return draw_picture(problem.comm, target, draw)


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
    bars = [bar for bar in (*net, *np.swapaxes(net, 0, 1)) if len(bar) > 1]
    tubes = [pv.lines_from_points(bar).tube(radius=0.005 * thickness * size) for bar in bars]
    points = balls(net.reshape(-1, 3), 0.014 * thickness * size)
    return [Layer(mesh, look) for mesh in (*tubes, points)]


@naming_arguments
def plot_convergence(
    history: Sequence[Record],
    path: str | Path | None = None,
    *,
    label: str = "objective",
    title: str = "",
    logarithmic: bool = False,
    width: int = 1200,
    comm: MPI.Comm | None = None,
) -> Picture:
    """Draw the objective of every evaluation: the start and serious steps connected, null steps as points.

    Args:
        history: That of the result of an optimisation, ``result.history``.
        label: Name of the objective, with its unit.
        logarithmic: Draw a positive objective logarithmically, so that a trial far off does not dominate.

    Raises:
        InvalidInputError: If it is no history, or a logarithmic objective is not positive.
    """
    target = png_path(path)
    if not isinstance(history, Sequence) or not history or not isinstance(history[0], Record):
        raise InvalidInputError(f"history must be result.history of a run, got {type(history).__name__}")
    objective = np.array([record.value for record in history])
    kind = np.array([record.kind.value for record in history])
    if logarithmic and np.nanmin(objective) <= 0.0:
        raise InvalidInputError(f"logarithmic=True needs a positive objective, got {np.nanmin(objective):g}")
    number, centre = np.arange(len(objective)), np.isin(kind, ("start", "serious", "refined"))
    first, last = objective[centre][0], objective[centre][-1]
    words = headline(title, f"{label} {change(first, last)}")

    def draw(paper: BinaryIO) -> None:
        with sheet(paper, (width, round(0.6 * width)), words) as figure:
            axes = figure.subplots()
            axes.set(xlabel="evaluation", ylabel=label, yscale="log" if logarithmic else "linear")
            main = {"color": BLUE, "lw": 2, "ms": 8, "label": "start and serious steps"}
            axes.plot(number[centre], objective[centre], "-o", **main)
            null, rejected = kind == "null", number[kind == "rejected"]
            if np.any(null):
                white = {"mfc": "white", "mec": ORANGE, "mew": 1.8, "ms": 8, "label": "null steps"}
                axes.plot(number[null], objective[null], "o", **white)
            if len(rejected):  # on the lower edge, as such a point has no value
                look = {"color": GREY, "ms": 8, "transform": axes.get_xaxis_transform()}
                axes.plot(rejected, np.full(len(rejected), 0.03), "x", label="rejected points", **look)
            axes.xaxis.set_major_locator(MaxNLocator(integer=True))
            axes.grid(axis="y", color=GREY, alpha=0.3)
            axes.legend(loc="best")

    return draw_picture(comm, target, draw)
