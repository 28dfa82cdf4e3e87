"""Picture of a field on bodies in space, with sections through the contact."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any, BinaryIO

import numpy as np

from fenics_contact.mesh import boundary_faces
from fenics_contact.scene import Scene
from fenics_contact.viz.colours import INK
from fenics_contact.viz.fields import Moved
from fenics_contact.viz.obstacles import obstacle_layers
from fenics_contact.viz.paints import Paints
from fenics_contact.viz.section import Spot, section_frame, section_layers, section_views
from fenics_contact.viz.sheet import TITLE, place_colour_bar, place_image, scale_bar, sheet
from fenics_contact.viz.stage import Layer, render, surface
from fenics_contact.viz.view import View, axis_label, frame_around, oblique_view

#: Part of the width that the pictures take; the rest is the colour bar's.
WIDE = 0.88
#: Room between pictures, relative to the width.
GAP = 0.03


@dataclass(frozen=True)
class _Detail:
    title: str
    image: np.ndarray
    size: float


def draw_in_space(
    scene: Scene, bodies: Mapping[str, Moved], spot: Spot | None, paper: BinaryIO, paints: Paints
) -> None:
    """Draw a field on the deformed bodies, and below two sections through a contact in true deformation.

    Args:
        scene: Gives the obstacles.
        bodies: The bodies.
        spot: Where the sections cut, or None.
        paper: Where the picture goes.
        paints: The field.
    """
    points = np.concatenate([body.deformed(paints.scale) for body in bodies.values()])
    view = oblique_view(points)
    obstacles, corners = obstacle_layers(scene, points, view)
    frame = frame_around(view, np.concatenate([points, corners]))
    wide = min(WIDE, 0.5 * float(frame.size[0] / frame.size[1]))
    layers = [*obstacles, *(_body_layer(name, body, paints) for name, body in bodies.items())]
    whole = render(layers, view, frame, round(wide * paints.width))
    details = [] if spot is None else _sections(bodies, spot, view, paints)
    top, below = round(TITLE * paints.width), round((TITLE + GAP) * paints.width) + whole.shape[0]
    height = below + details[0].image.shape[0] if details else below
    with sheet(paper, (paints.width, height + top // 2), paints.headline) as figure:
        place_image(figure, whole, round(WIDE * paints.width - whole.shape[1]) // 2, top)
        _place_sections(figure, details, below, paints)
        box = (round((WIDE + 0.02) * paints.width), top, height - top)
        place_colour_bar(figure, box, paints.key, paints.label, extend=paints.extend)


def _place_sections(figure: Any, details: list[_Detail], top: int, paints: Paints) -> None:
    gap = round(GAP * paints.width)
    left = (round((WIDE + GAP) * paints.width) - sum(detail.image.shape[1] + gap for detail in details)) // 2
    for detail in details:
        axes = place_image(figure, detail.image, left, top, detail.title)
        scale_bar(axes, detail.image, detail.size, paints.units.length)
        left += detail.image.shape[1] + gap


def _body_layer(name: str, body: Moved, paints: Paints) -> Layer:
    faces, cells = boundary_faces(body.mesh.cells, body.mesh.dim)
    mesh = surface(body.deformed(paints.scale), faces)
    shown = paints.shown(name)
    if len(shown) == body.mesh.n_nodes:
        mesh.point_data["shown"] = shown[mesh.point_data["node"]]
    else:
        mesh.cell_data["shown"] = shown[cells]
    edges = {"show_edges": True, "edge_color": INK, "edge_opacity": 0.12, "line_width": 1}
    shading = {
        # So much light from all sides that colours of faces in shade can be found on the bar.
        "ambient": 0.75,
        "diffuse": 0.28,
        "smooth_shading": True,
        "split_sharp_edges": True,
        "feature_angle": 50,
    }
    return Layer(mesh, {"scalars": "shown", **paints.of_surfaces, **edges, **shading})


def _sections(bodies: Mapping[str, Moved], spot: Spot, main: View, paints: Paints) -> list[_Detail]:
    points = np.concatenate([body.deformed(1.0) for body in bodies.values()])
    scalars = {name: paints.shown(name) for name in bodies}
    views = section_views(spot, main)
    frames = [section_frame(view, spot, points, paints.reach) for view in views]
    # All are equally high and together as wide as the picture, but not higher than half of that.
    proportions = [float(frame.size[0] / frame.size[1]) for frame in frames]
    height = paints.width * min((WIDE - 2 * GAP) / sum(proportions), 0.4)
    details = []
    for view, frame, proportion in zip(views, frames, proportions, strict=True):
        layers = section_layers(bodies, scalars, view, spot.centre, paints.of_surfaces)
        image = render(layers, view, frame, round(proportion * height))
        across = axis_label(view.towards).strip("−")
        title = f"section across {across}" if across else "section"
        details.append(_Detail(f"{title}; displacement × 1", image, float(frame.size[0])))
    smallest = min(detail.image.shape[0] for detail in details)
    return [_Detail(detail.title, detail.image[:smallest], detail.size) for detail in details]
