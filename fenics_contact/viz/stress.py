"""Picture of the von Mises stress in the deformed bodies, with sections through the contact."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np

from fenics_contact.contact import State
from fenics_contact.errors import InvalidInputError
from fenics_contact.geometry import boundary_faces
from fenics_contact.scene import Scene
from fenics_contact.viz.colours import INK, STRESS_MAP
from fenics_contact.viz.fields import BodyFields, gather
from fenics_contact.viz.obstacles import obstacle_layers, obstacles_of
from fenics_contact.viz.places import contact_places
from fenics_contact.viz.section import Spot, section_frame, section_layers, section_views, strongest_contact
from fenics_contact.viz.sheet import (
    TITLE,
    draw_on_one_rank,
    place_colour_bar,
    place_image,
    png_path,
    scale_bar,
    sheet,
)
from fenics_contact.viz.stage import Layer, render, surface
from fenics_contact.viz.stress_in_plane import PlaneLook, contact_window, draw_stress_in_plane
from fenics_contact.viz.units import Units
from fenics_contact.viz.view import View, axis_label, frame_around, oblique_view
from fenics_contact.viz.words import checked_range, checked_reach, headline, nice_number, written

#: Fraction of the bodies' size that the largest displacement appears to have.
VISIBLE = 0.03
#: The colours end at this quantile of the cells: the peak under a contact would leave the rest in one shade.
QUANTILE = 0.995
#: Part of the width that the pictures take; the rest is the colour bar's.
WIDE = 0.88
#: Room between pictures, relative to the width.
GAP = 0.03


def plot_stress(
    state: State,
    path: str | Path,
    *,
    clim: tuple[float, float] | None = None,
    scale: float | None = None,
    sections: bool = True,
    reach: float | None = None,
    smooth: bool = True,
    title: str = "",
    units: Units | None = None,
    width: int = 1600,
) -> Path:
    """Draw the von Mises stress on the deformed bodies. Collective.

    Below, two sections through the middle of the strongest contact, in true deformation: bodies whose
    displacement is exaggerated overlap where they touch. Plane bodies are shown in their plane, and beside
    them where they touch, if that is small. Rigid obstacles are shaded in the plane; in space planes are
    shown as sheets, spheres and cylinders by their outlines, others not at all.

    Args:
        state: The state.
        path: PNG file to write.
        clim: Range of the colours, [force / length²]; from zero to the 99.5 % quantile unless given. Give two
            pictures the same range to compare them.
        scale: Factor of the displacement in the upper picture; chosen and stated unless given, 1 where there
            are rigid obstacles.
        sections: Draw the sections too, if a contact carries force.
        reach: How far sections reach up and down from the contact's middle, [length]; chosen unless given.
        smooth: Show nodal means instead of the cells' own values.
        title: What comes before the facts in the title.
        units: Names of the units, mm, N and MPa unless given.
        width: Width of the picture in pixels.

    Returns:
        The path.

    Raises:
        InvalidInputError: If an option or the name of the file cannot be used.
        MissingRequirementError: If this machine cannot render.
    """
    target = png_path(path)
    if scale is not None and not np.isfinite(scale):
        raise InvalidInputError(
            f"scale must be finite, got {scale}: give the factor of the displacement, such as 10"
        )
    checked_reach(reach)
    given = None if clim is None else checked_range(clim)
    bodies = gather(state)
    # Exaggerated, bodies would enter rigid obstacles.
    chosen = 1.0 if obstacles_of(state.scene) else chosen_scale(bodies)
    factor = chosen if scale is None else float(scale)
    shown, named = given or stress_range(bodies), units or Units()
    places = contact_places(state, {name: body.deformed(1.0) for name, body in bodies.items()})
    touching = sections and bool(np.any(state.contact.normal_force > 0))

    def draw() -> None:
        if state.scene.dim == 2:
            window = contact_window(state.contact, places, reach) if touching else None
            plain = PlaneLook(shown, factor, smooth, title, named, width)
            draw_stress_in_plane(state.scene, bodies, window, target, plain)
            return
        look = _Look(shown, factor, smooth, reach, title, named, width)
        spot = strongest_contact(state.contact, places) if touching else None
        _draw(state.scene, bodies, spot, target, look)

    draw_on_one_rank(state.torn.decomposition.comm, draw)
    return target


def stress_range(bodies: Mapping[str, BodyFields]) -> tuple[float, float]:
    """Return the default range of the colours, from zero to a round number above a high quantile."""
    top = float(np.quantile(np.concatenate([body.von_mises for body in bodies.values()]), QUANTILE))
    if top <= 0:
        return 0.0, 1.0
    step = 10.0 ** np.floor(np.log10(top)) / 2
    return 0.0, float(step * np.ceil(top / step))


def chosen_scale(bodies: Mapping[str, BodyFields]) -> float:
    """Return the round factor, at least 1, that makes the displacement visible."""
    moved = max(float(np.linalg.norm(body.displacement, axis=1).max()) for body in bodies.values())
    extent = np.ptp(np.concatenate([body.mesh.points for body in bodies.values()]), axis=0)
    return max(1.0, nice_number(VISIBLE * float(extent.max()) / moved)) if moved > 0 else 1.0


@dataclass(frozen=True)
class _Look:
    clim: tuple[float, float]
    scale: float
    smooth: bool
    reach: float | None
    title: str
    units: Units
    width: int

    @property
    def colours(self) -> dict[str, Any]:
        """Keywords of ``add_mesh``."""
        return {"cmap": STRESS_MAP, "clim": self.clim, "n_colors": 256}

    def scalars(self, body: BodyFields) -> np.ndarray:
        """Return what is shown of a body, on nodes or cells."""
        return body.nodal_von_mises if self.smooth else body.von_mises


@dataclass(frozen=True)
class _Detail:
    title: str
    image: np.ndarray
    size: float


def _draw(
    scene: Scene, bodies: Mapping[str, BodyFields], spot: Spot | None, target: Path, look: _Look
) -> None:
    points = np.concatenate([body.deformed(look.scale) for body in bodies.values()])
    view = oblique_view(points)
    obstacles, corners = obstacle_layers(scene, points, view)
    frame = frame_around(view, np.concatenate([points, corners]))
    wide = min(WIDE, 0.5 * float(frame.size[0] / frame.size[1]))
    layers = [*obstacles, *(_body_layer(body, look) for body in bodies.values())]
    whole = render(layers, view, frame, round(wide * look.width))
    details = [] if spot is None else _sections(bodies, spot, view, look)
    peak = max(float(body.von_mises.max()) for body in bodies.values())
    facts = f"von Mises stress, largest {written(peak)} {look.units.stress}; displacement × {look.scale:g}"
    top, below = round(TITLE * look.width), round((TITLE + GAP) * look.width) + whole.shape[0]
    height = below + details[0].image.shape[0] if details else below
    with sheet(target, (look.width, height + top // 2), headline(look.title, facts)) as figure:
        place_image(figure, whole, round(WIDE * look.width - whole.shape[1]) // 2, top)
        _place_sections(figure, details, below, look)
        label, extend = f"von Mises stress ({look.units.stress})", "max" if peak > look.clim[1] else "neither"
        box = (round((WIDE + 0.02) * look.width), top, height - top)
        place_colour_bar(figure, box, STRESS_MAP, look.clim, label, extend=extend)


def _place_sections(figure: Any, details: list[_Detail], top: int, look: _Look) -> None:
    gap = round(GAP * look.width)
    left = (round((WIDE + GAP) * look.width) - sum(detail.image.shape[1] + gap for detail in details)) // 2
    for detail in details:
        axes = place_image(figure, detail.image, left, top, detail.title)
        scale_bar(axes, detail.image, detail.size, look.units.length)
        left += detail.image.shape[1] + gap


def _body_layer(body: BodyFields, look: _Look) -> Layer:
    faces, cells = boundary_faces(body.mesh.cells, body.mesh.dim)
    mesh = surface(body.deformed(look.scale), faces)
    if look.smooth:
        mesh.point_data["shown"] = look.scalars(body)[mesh.point_data["node"]]
    else:
        mesh.cell_data["shown"] = body.von_mises[cells]
    edges = {"show_edges": True, "edge_color": INK, "edge_opacity": 0.12, "line_width": 1}
    shading = {
        "ambient": 0.6,
        "diffuse": 0.42,
        "smooth_shading": True,
        "split_sharp_edges": True,
        "feature_angle": 50,
    }
    return Layer(mesh, {"scalars": "shown", **look.colours, **edges, **shading})


def _sections(bodies: Mapping[str, BodyFields], spot: Spot, main: View, look: _Look) -> list[_Detail]:
    points = np.concatenate([body.deformed(1.0) for body in bodies.values()])
    scalars = {name: look.scalars(body) for name, body in bodies.items()}
    views = section_views(spot, main)
    frames = [section_frame(view, spot, points, look.reach) for view in views]
    # All are equally high and together as wide as the picture, but not higher than half of that.
    proportions = [float(frame.size[0] / frame.size[1]) for frame in frames]
    height = look.width * min((WIDE - GAP) / sum(proportions), 0.4)
    details = []
    for view, frame, proportion in zip(views, frames, proportions, strict=True):
        layers = section_layers(bodies, scalars, view, spot.centre, look.colours)
        image = render(layers, view, frame, round(proportion * height))
        across = axis_label(view.towards).strip("−")
        title = f"section across {across}" if across else "section"
        details.append(_Detail(f"{title}; displacement × 1", image, float(frame.size[0])))
    smallest = min(detail.image.shape[0] for detail in details)
    return [_Detail(detail.title, detail.image[:smallest], detail.size) for detail in details]
