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
from fenics_contact.viz.colours import INK, STRESS_MAP
from fenics_contact.viz.fields import BodyFields, gather
from fenics_contact.viz.places import contact_places
from fenics_contact.viz.section import contact_centre, half_width, section_frame, section_layers, section_views
from fenics_contact.viz.sheet import (
    checked_range,
    colour_bar,
    draw_on_one_rank,
    nice_number,
    png_path,
    scale_bar,
    sheet,
    show_image,
    written,
)
from fenics_contact.viz.stage import Layer, render, surface
from fenics_contact.viz.units import Units
from fenics_contact.viz.view import View, axis_label, frame_around, oblique_view

#: Fraction of the bodies' size that the largest displacement appears to have.
VISIBLE = 0.03
#: Width of a section by its height.
PROPORTION = 1.4
#: The colours end at this quantile of the cells' stresses: the peak under a contact would leave the rest in one shade.
QUANTILE = 0.995


def plot_stress(
    state: State,
    path: str | Path,
    *,
    clim: tuple[float, float] | None = None,
    scale: float | None = None,
    sections: bool = True,
    smooth: bool = True,
    title: str = "",
    units: Units | None = None,
    width: int = 1600,
) -> Path:
    """Draw the von Mises stress on the deformed bodies. Collective.

    Below, two sections through the middle of the contact, in true deformation: bodies whose displacement is
    exaggerated overlap where they touch.

    Args:
        state: The state.
        path: PNG file to write.
        clim: Range of the colours, [force / length²]; from zero to the 99.5 % quantile unless given. Give two
            pictures the same range to compare them.
        scale: Factor of the displacement in the upper picture; chosen and stated unless given.
        sections: Draw the sections too, if a contact carries force.
        smooth: Show nodal means instead of the cells' own values.
        title: What comes before the facts in the title.
        units: Names of the units, mm, N and MPa unless given.
        width: Width of the picture in pixels.

    Returns:
        The path.

    Raises:
        InvalidInputError: If the range, the scale or the name of the file cannot be used.
        MissingRequirementError: If this machine cannot render.
    """
    target = png_path(path)
    if scale is not None and not np.isfinite(scale):
        raise InvalidInputError(f"scale must be finite, got {scale}: give the factor of the displacement, such as 10")
    given = None if clim is None else checked_range(clim)
    bodies = gather(state)
    look = _Look(
        given or stress_range(bodies),
        chosen_scale(bodies) if scale is None else float(scale),
        smooth,
        title,
        units or Units(),
        width,
    )
    with_sections = sections and bool(np.any(state.contact.normal_force > 0))
    draw_on_one_rank(
        state.system.torn.decomposition.comm,
        lambda: _draw(bodies, state if with_sections else None, target, look),
    )
    return target


@dataclass(frozen=True)
class _Look:
    clim: tuple[float, float]
    scale: float
    smooth: bool
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


def stress_range(bodies: Mapping[str, BodyFields]) -> tuple[float, float]:
    """Return the default range of the colours, from zero to a round number near a high quantile."""
    top = float(np.quantile(np.concatenate([body.von_mises for body in bodies.values()]), QUANTILE))
    if top <= 0:
        return 0.0, 1.0
    step = 10.0 ** np.floor(np.log10(top)) / 2
    return 0.0, float(step * np.ceil(top / step))


def chosen_scale(bodies: Mapping[str, BodyFields]) -> float:
    """Return the round factor that makes the displacement visible; 1 where nothing moves."""
    moved = max(float(np.linalg.norm(body.displacement, axis=1).max()) for body in bodies.values())
    extent = np.ptp(np.concatenate([body.mesh.points for body in bodies.values()]), axis=0)
    return nice_number(VISIBLE * float(extent.max()) / moved) if moved > 0 else 1.0


def _draw(bodies: Mapping[str, BodyFields], state: State | None, target: Path, look: _Look) -> None:
    points = np.concatenate([body.deformed(look.scale) for body in bodies.values()])
    view = oblique_view(points)
    layers = [_body_layer(body, look) for body in bodies.values()]
    wide = int(0.88 * look.width)
    whole = render(layers, view, frame_around(view, points), wide)
    details = [] if state is None else _sections(bodies, state, view, look, wide // 2)
    peak = max(float(body.von_mises.max()) for body in bodies.values())
    facts = f"von Mises stress, largest {written(peak)} {look.units.stress}; displacement × {look.scale:g}"
    height = whole.shape[0] + 90 + (details[0].image.shape[0] + 40 if details else 0)
    with sheet(target, (look.width, height), f"{look.title}: {facts}" if look.title else facts) as figure:
        _compose(figure, whole, details, look.units)
        extend = "max" if peak > look.clim[1] else "neither"
        label = f"von Mises stress ({look.units.stress})"
        colour_bar(figure, figure.axes, STRESS_MAP, look.clim, label, extend=extend, aspect=40, fraction=0.05, pad=0.01)


@dataclass(frozen=True)
class _Detail:
    title: str
    image: np.ndarray
    size: float


def _compose(figure: Any, whole: np.ndarray, details: list[_Detail], units: Units) -> None:
    if not details:
        show_image(figure.subplots(), whole)
        return
    grid = figure.add_gridspec(2, len(details), height_ratios=[whole.shape[0], details[0].image.shape[0]])
    show_image(figure.add_subplot(grid[0, :]), whole)
    for column, detail in enumerate(details):
        axes = figure.add_subplot(grid[1, column])
        show_image(axes, detail.image, detail.title)
        scale_bar(axes, detail.image, detail.size, units.length)


def _body_layer(body: BodyFields, look: _Look) -> Layer:
    faces, cells = boundary_faces(body.mesh.cells)
    mesh = surface(body.deformed(look.scale), faces)
    if look.smooth:
        mesh.point_data["shown"] = look.scalars(body)[mesh.point_data["node"]]
    else:
        mesh.cell_data["shown"] = body.von_mises[cells]
    edges = {"show_edges": True, "edge_color": INK, "edge_opacity": 0.12, "line_width": 1}
    return Layer(mesh, {"scalars": "shown", **look.colours, **edges, "ambient": 0.6, "diffuse": 0.42, "smooth_shading": True})


def _sections(
    bodies: Mapping[str, BodyFields], state: State, main: View, look: _Look, width: int
) -> list[_Detail]:
    places = contact_places(state, {name: body.deformed(1.0) for name, body in bodies.items()})
    centre = contact_centre(state.contact, places)
    half = half_width(state.contact, np.concatenate([body.mesh.points for body in bodies.values()]))
    scalars = {name: look.scalars(body) for name, body in bodies.items()}
    details = []
    for view in section_views(state.contact, main):
        frame = section_frame(view, centre, half, PROPORTION)
        image = render(section_layers(bodies, scalars, view, centre, look.colours), view, frame, width)
        across = axis_label(view.towards).strip("−")
        where = f"cut perpendicular to {across}" if across else "cut"
        details.append(_Detail(f"{where} through the contact, true deformation", image, float(frame.size[0])))
    return details
