"""Drawing a field on bodies: all of them, and the contact at a larger scale."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass
from functools import partial
from pathlib import Path
from typing import TYPE_CHECKING, BinaryIO

import numpy as np
from matplotlib.axes import Axes

from fenics_contact.surface_shapes import SurfaceShape
from fenics_contact.viz.colours import INK
from fenics_contact.viz.fields import Bodies, cells_of, is_plane, moved, points_of
from fenics_contact.viz.obstacles import obstacle_layers, shade_obstacles
from fenics_contact.viz.paints import Paints
from fenics_contact.viz.patch_axes import label_axes
from fenics_contact.viz.picture import Picture, draw_picture
from fenics_contact.viz.plane import draw_cell_edges, draw_field, draw_outline
from fenics_contact.viz.section import Spot, section_frame, section_layers, sections_of
from fenics_contact.viz.sheet import sheet, show_image
from fenics_contact.viz.stage import AXES, Layer, render
from fenics_contact.viz.units import Units
from fenics_contact.viz.view import IN_PLANE, Frame, View, frame_around, oblique_view

if TYPE_CHECKING:
    from mpi4py import MPI

#: Half size of the detail of a plane picture, relative to half the length of the closed contact.
REACH = 2.5
#: A detail in the plane that shows more than this fraction of the bodies is omitted.
LARGEST_DETAIL = 0.4
#: Fraction of the width for pictures; the rest is for the colour bar.
WIDE = 0.84

_LOOK = {
    "show_edges": True, "edge_color": INK, "edge_opacity": 0.12, "line_width": 1,
    # Enough ambient light that colours of shaded faces match the bar.
    "ambient": 0.75, "diffuse": 0.28, "smooth_shading": True, "split_sharp_edges": True, "feature_angle": 50,
}  # fmt: skip


@dataclass(frozen=True, eq=False)
class _Part:
    """A part of the picture, and the function that draws it on matplotlib's axes."""

    frame: Frame
    draw: Callable[[Axes], None]


def paint(
    bodies: Bodies,
    paints: Paints,
    path: Path | None,
    *,
    obstacles: list[SurfaceShape],
    spot: Spot | None = None,
    comm: MPI.Comm | None = None,
) -> Picture:
    """Draw a field on all bodies, with details of a contact in true deformation. Collective on ``comm``.

    Args:
        bodies: Undeformed bodies with linear cells and, if they moved, their ``displacement``.
        paints: The field.
        path: PNG file to write, or None.
        obstacles: Rigid obstacles to draw beside them.
        spot: The contact of which a detail is drawn, in space two sections; None for no detail.
        comm: Communicator, None if this rank draws for itself.
    """
    painted = paints.on(bodies)
    plane = all(map(is_plane, bodies.values()))
    parts_of = _in_plane if plane else _in_space
    return draw_picture(
        comm, path, lambda paper: _draw(parts_of(painted, obstacles, spot, paints), paper, paints)
    )


def _draw(parts: Sequence[_Part], paper: BinaryIO, paints: Paints) -> None:
    """Place details below the main part, or beside it where that is not wide."""
    main, *details = parts
    beside = len(details) == 1 and main.frame.proportion < 2.2
    rows = [[*parts]] if beside or not details else [[main], details]
    wide = [part.frame.proportion for part in rows[-1]]
    high = [min(WIDE / sum(part.frame.proportion for part in row), 0.5) for row in rows]
    height = round(float(np.clip(sum(high) + 0.09 * len(rows), 0.3, 1.3)) * paints.width)
    names = [[str(parts.index(part)) for part in row] for row in rows]
    names[0] *= len(wide) // len(names[0])
    with sheet(paper, (paints.width, height), paints.headline) as figure:
        panels = figure.subplot_mosaic(names, width_ratios=wide, height_ratios=high)
        for number, part in enumerate(parts):
            part.draw(panels[str(number)])
        paints.add_bar(figure, panels.values())


def _in_plane(
    bodies: Bodies, obstacles: list[SurfaceShape], spot: Spot | None, paints: Paints
) -> list[_Part]:
    """All bodies, and the contact if it is small."""
    everything = moved(bodies, paints.scale)
    frame = frame_around(IN_PLANE, points_of(everything), 0.04)
    parts = [_Part(frame, partial(_draw_plane, everything, obstacles, frame, paints, ""))]
    if spot is not None:
        half = REACH * spot.radius if paints.reach is None else paints.reach
        detail = Frame(spot.centre - half, spot.centre + half)
        if 2 * half < LARGEST_DETAIL * float(np.max(frame.size)) / 1.08:
            words, true = "where they touch; displacement × 1", moved(bodies, 1.0)
            parts.append(_Part(detail, partial(_draw_plane, true, obstacles, detail, paints, words)))
    return parts


def _draw_plane(
    bodies: Bodies, obstacles: list[SurfaceShape], frame: Frame, paints: Paints, title: str, axes: Axes
) -> None:
    shade_obstacles(axes, obstacles, frame)
    look = {"cmap": paints.colours, "vmin": 0.0, "vmax": 1.0}
    for body in bodies.values():
        points, cells = np.asarray(body.points)[:, :2], cells_of(body)
        draw_field(axes, points, cells, np.asarray(body["shown"]), look)
        draw_cell_edges(axes, points, cells, frame)
        draw_outline(axes, points, cells)
    unit = paints.units.length
    axes.set(title=title, xlabel=f"x ({unit})", ylabel=f"y ({unit})")
    frame.fit(axes)


def _in_space(
    bodies: Bodies, obstacles: list[SurfaceShape], spot: Spot | None, paints: Paints
) -> list[_Part]:
    """All bodies, and two sections through the contact on axes of their own."""
    everything = moved(bodies, paints.scale)
    points = points_of(everything)
    view = oblique_view(points)
    layers, corners = obstacle_layers(obstacles, points, view)
    for body in everything.values():
        layers.append(Layer(body.extract_surface(algorithm=None), {**paints.of_surfaces, **_LOOK}))
    frame = frame_around(view, np.concatenate([points, corners]))
    # room for the directions of the axes
    frame = Frame(frame.low - [AXES / 2 * float(np.min(frame.size)), 0.0], frame.high)
    image = render(layers, view, frame, round(paints.width * WIDE), axes=True)
    parts = [_Part(frame, partial(show_image, image=image, frame=frame))]
    return parts if spot is None else [*parts, *_sections(moved(bodies, 1.0), spot, view, paints)]


def _sections(bodies: Bodies, spot: Spot, main: View, paints: Paints) -> Iterator[_Part]:
    """Render two sections through a contact, to be shown on axes with coordinates."""
    for section in sections_of(spot, main):
        frame = section_frame(section.view, spot, points_of(bodies), paints.reach)
        layers = section_layers(bodies, section, paints.of_surfaces)
        image = render(layers, section.view, frame, paints.width // 2)
        title = f"{section.title(frame, paints.units.length)}; displacement × 1"
        yield _Part(frame, partial(_draw_section, image, frame, title, section.view, paints.units))


def _draw_section(image: np.ndarray, frame: Frame, title: str, view: View, units: Units, axes: Axes) -> None:
    show_image(axes, image, frame, title, coordinates=True)
    label_axes(axes, view, units)
