"""Drawing a field on the bodies of a state: all of them, and the contact at a larger scale."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from functools import partial
from pathlib import Path
from typing import BinaryIO

import numpy as np
from matplotlib.axes import Axes

from fenics_contact.contact import State
from fenics_contact.viz.axes_sign import axes_sign, empty_corner, far_corner
from fenics_contact.viz.colours import INK
from fenics_contact.viz.fields import Bodies, cells_of, contact_places, moved, points_of
from fenics_contact.viz.obstacles import obstacle_layers, shade_obstacles
from fenics_contact.viz.paints import Paints
from fenics_contact.viz.picture import Picture, draw_picture
from fenics_contact.viz.plane import draw_cell_edges, draw_field, draw_outline
from fenics_contact.viz.section import Spot, section_frame, section_layers, sections_of, strongest_contact
from fenics_contact.viz.sheet import scale_bar, sheet, show_image
from fenics_contact.viz.stage import Layer, render
from fenics_contact.viz.view import IN_PLANE, Frame, View, frame_around, oblique_view

#: Half size of the detail of a plane picture, relative to half the length of the closed contact.
REACH = 2.5
#: A detail in the plane that shows more than this fraction of the bodies is omitted.
LARGEST_DETAIL = 0.4
#: Parts wider than this relative to their height have scale and axes below them.
SLENDER = 4.0
#: Fraction of the width for pictures; the rest is for the colour bar.
WIDE = 0.84

_LOOK = {
    "show_edges": True, "edge_color": INK, "edge_opacity": 0.12, "line_width": 1,
    # Enough ambient light that colours of shaded faces match the bar.
    "ambient": 0.75, "diffuse": 0.28, "smooth_shading": True, "split_sharp_edges": True, "feature_angle": 50,
}  # fmt: skip


@dataclass(frozen=True)
class _Part:
    """A part of the picture, and the function that draws it on matplotlib's axes."""

    frame: Frame
    draw: Callable[[Axes], None]


def paint(state: State, bodies: Bodies, paints: Paints, path: Path | None, *, sections: bool) -> Picture:
    """Draw a field on all bodies, with details of the strongest contact in true deformation. Collective.

    Args:
        state: The state.
        bodies: Its undeformed bodies, see `drawn_bodies`.
        paints: The field.
        path: PNG file to write, or None.
        sections: Whether to draw the details, if a contact carries force: in space two sections.
    """
    painted = paints.on(bodies)
    touching = sections and bool(np.any(state.contact.normal_force > 0))
    places = contact_places(state, moved(bodies, 1.0))
    spot = strongest_contact(state.contact, places) if touching else None
    plane = state.scene.dim == 2

    def draw(paper: BinaryIO) -> None:
        parts = (_in_plane if plane else _in_space)(state, painted, spot, paints)
        _draw(parts, paper, paints, below=not plane or parts[0].frame.proportion > 2.2)

    return draw_picture(state.torn.decomposition.comm, path, draw)


def _draw(parts: Sequence[_Part], paper: BinaryIO, paints: Paints, *, below: bool) -> None:
    """Place details below or beside the main part, lines as wide as the picture and not too high."""
    lines = _lines(parts) if below else [parts]
    wide = [[part.frame.proportion for part in line] for line in lines]
    most = [0.5] + [0.4] * (len(lines) - 1) if below else [np.inf]
    high = [min(WIDE / sum(line), limit) for line, limit in zip(wide, most, strict=True)]
    height = sum(high) + (0.07 * len(lines) if below else 0.12)
    size = paints.width, round(float(np.clip(height, 0.3, 1.3)) * paints.width)
    with sheet(paper, size, paints.headline) as figure:
        columns = max(wide, key=len)
        grid = figure.add_gridspec(len(lines), len(columns), height_ratios=high, width_ratios=columns)
        places = [
            grid[row, :] if len(line) == 1 else grid[row, column]
            for row, line in enumerate(lines)
            for column in range(len(line))
        ]
        panels = [figure.add_subplot(place) for place in places]
        for axes, part in zip(panels, parts, strict=True):
            part.draw(axes)
        paints.add_bar(figure, panels)


def _lines(parts: Sequence[_Part]) -> list[Sequence[_Part]]:
    """Return the main part and its details in lines: details in one, unless one would be tiny there."""
    main, *details = parts
    wide = [part.frame.proportion for part in details]
    apart = len(wide) > 1 and max(wide) > 3.0 * min(wide)
    return [[main], *([part] for part in details)] if apart else [[main], *([details] if details else [])]


def _in_plane(state: State, bodies: Bodies, spot: Spot | None, paints: Paints) -> list[_Part]:
    """All bodies, and the contact if it is small."""
    everything = moved(bodies, paints.scale)
    frame = frame_around(IN_PLANE, points_of(everything), 0.04)
    parts = [_Part(frame, partial(_draw_plane, state, everything, frame, paints, ""))]
    if spot is not None:
        half = REACH * spot.radius if paints.reach is None else paints.reach
        frame, size = Frame(spot.centre - half, spot.centre + half), float(np.max(frame.size))
        if 2 * half < LARGEST_DETAIL * size / 1.08:
            words = "where they touch; displacement × 1"
            parts.append(_Part(frame, partial(_draw_plane, state, moved(bodies, 1.0), frame, paints, words)))
    return parts


def _draw_plane(state: State, bodies: Bodies, frame: Frame, paints: Paints, title: str, axes: Axes) -> None:
    shade_obstacles(axes, state, frame)
    for body in bodies.values():
        points, cells = np.asarray(body.points)[:, :2], cells_of(body)
        draw_field(axes, points, cells, np.asarray(body["shown"]), paints.of_cells)
        draw_cell_edges(axes, points, cells, frame)
        draw_outline(axes, points, cells)
    unit = paints.units.length
    axes.set(title=title, xlabel=f"x ({unit})", ylabel=f"y ({unit})")
    frame.fit(axes)


def _in_space(state: State, bodies: Bodies, spot: Spot | None, paints: Paints) -> list[_Part]:
    """All bodies, and two sections through the contact."""
    everything = moved(bodies, paints.scale)
    points = points_of(everything)
    view = oblique_view(points)
    layers, corners = obstacle_layers(state, points, view)
    for body in everything.values():
        layers.append(Layer(body.extract_surface(algorithm=None), {**paints.of_surfaces, **_LOOK}))
    parts = [_image(layers, view, frame_around(view, np.concatenate([points, corners])), paints)]
    if spot is None:
        return parts
    true = moved(bodies, 1.0)
    for section in sections_of(spot, view):
        frame = section_frame(section.view, spot, points_of(true), paints.reach)
        layers = section_layers(true, section, paints.of_surfaces)
        title = f"{section.title(frame, paints.units.length)}; displacement × 1"
        corner = far_corner(frame, section.view.project(spot.centre[None])[0])
        parts.append(_image(layers, section.view, frame, paints, (title, corner)))
    return parts


def _image(
    layers: Sequence[Layer], view: View, frame: Frame, paints: Paints, detail: tuple[str, str] | None = None
) -> _Part:
    """Render an image with a sign of its axes; ``detail`` is the title of a section and the sign's corner."""
    image = render(layers, view, frame, round(paints.width * (0.45 if detail else WIDE)))

    def draw(axes: Axes) -> None:
        title, corner = detail or ("", empty_corner(image))
        show_image(axes, image, frame, title)
        below = frame.proportion > SLENDER
        axes_sign(axes, view, corner, below=below)
        if detail:
            scale_bar(axes, frame, paints.units.length, below=below)

    return _Part(frame, draw)
