"""Picture of the result of an optimisation: contact before and after, and the moved outlines."""

from __future__ import annotations

from dataclasses import dataclass, replace
from pathlib import Path
from typing import BinaryIO

import numpy as np
import pyvista as pv
from matplotlib.axes import Axes
from matplotlib.collections import LineCollection
from matplotlib.figure import Figure
from scipy.spatial import cKDTree

from fenics_contact.contact import State, body_grid, in_space
from fenics_contact.errors import InvalidInputError
from fenics_contact.shape import DesignPoint
from fenics_contact.viz.colours import BLUE, GREY, INK, ORANGE
from fenics_contact.viz.fields import points_of
from fenics_contact.viz.painting import REACH
from fenics_contact.viz.patch import checked_pair, contact_patches
from fenics_contact.viz.patch_axes import label_axes, label_patch, pressure_bar
from fenics_contact.viz.picture import Picture, draw_picture, png_path
from fenics_contact.viz.pressure import draw_pressure
from fenics_contact.viz.section import cut, section_frame, sections_of, strongest_contact
from fenics_contact.viz.sheet import sheet
from fenics_contact.viz.trace import contact_trace
from fenics_contact.viz.units import Units
from fenics_contact.viz.view import IN_PLANE, Frame, View, frame_around, oblique_view
from fenics_contact.viz.words import change, checked_range, checked_reach, headline, nice_number, written

#: Apparent size of the largest movement relative to the picture.
VISIBLE = 0.06
#: Margin around the bodies, relative to their size.
BORDER = 0.08


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
        path: PNG file to write, None to write none.
        pair: Number of the contact pair in the scene.
        clim: Range of the pressure, [force / length²]; from zero to the largest of both unless given.
        reach: How far pictures reach around the contact's middle, [length]; chosen unless given.
        label: Name of the objective with its unit.
        title: Text before the facts in the title.
        units: Names of the units, mm, N and MPa unless given.
        width: Width of the picture in pixels.

    Returns:
        The picture, which can be used like a path to its file.

    Raises:
        InvalidInputError: If the two do not belong to the same scene, it has no such pair, nothing touches
            before, or an option cannot be used.
    """
    target = png_path(path)
    states = [point.state if isinstance(point, DesignPoint) else point for point in (first, best)]
    before, after = states
    _check(before, after, pair)
    checked_reach(reach)
    given = None if clim is None else checked_range(clim)
    named, plane = units or Units(), before.scene.dim == 2
    peaks = [float(state.contact.pressure[state.contact.on_pair(pair)].max(initial=0.0)) for state in states]
    values = [each.value for each in (first, best) if isinstance(each, DesignPoint)]
    facts = [f"{label} {change(*values)}"] if len(values) == 2 else []
    if len(values) < 2 or not np.allclose(values, peaks, rtol=1e-6):
        facts.append(f"largest pressure {written(peaks[0])} → {written(peaks[1])} {named.stress}")
    facts.append(f"seat gives way by {written(_retreat(before, after, pair), 2)} {named.length}")
    shown, words = given or (0.0, max(peaks) or 1.0), headline(title, "; ".join(facts))

    def draw(paper: BinaryIO) -> None:
        outlines = _outlines(before, after, reach, named.length)
        with sheet(paper, (width, round((0.5 if plane else 0.95) * width)), words) as figure:
            if plane:
                left, *panels = figure.subplots(1, 2)
                _draw_traces(left, states, pair, shown, reach, named)
            else:
                upper, lower = figure.subfigures(2, 1, height_ratios=[0.48, 0.47])
                _draw_patches(upper, states, pair, shown, reach, named)
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
        {name: body.mesh.cells.shape for name, body in state.scene.bodies.items()} for state in (first, best)
    ]
    if cells[0] != cells[1]:
        raise InvalidInputError(
            f"before and after must have the same bodies and cells, got {cells[0]} and {cells[1]}: give two "
            "designs of one scene"
        )
    checked_pair(first, pair)
    if not np.any(first.contact.normal_force > 0):
        raise InvalidInputError(
            "a picture of before and after needs contact forces before, got none: draw with plot_stress"
        )


def _draw_patches(
    figure: Figure,
    states: list[State],
    pair: int,
    clim: tuple[float, float],
    reach: float | None,
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
    reach: float | None,
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


def _outlines(first: State, best: State, reach: float | None, unit: str) -> list[_Outlines]:
    """Return the outlines around the strongest contact before: in the plane one, in space two sections."""
    bodies: dict[str, pv.DataSet] = {}
    for name, body in first.scene.bodies.items():
        bodies[name] = body_grid(body.mesh.linear, in_space(body.mesh.points))
        bodies[name].point_data["moves"] = in_space(best.scene.bodies[name].mesh.points - body.mesh.points)
    spot, points = strongest_contact(first.contact, first.contact_places), points_of(bodies)
    if first.scene.dim == 2:
        half, whole = REACH * spot.radius if reach is None else reach, frame_around(IN_PLANE, points, BORDER)
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
