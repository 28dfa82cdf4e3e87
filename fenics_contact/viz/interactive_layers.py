"""Contents of a scene for the browser: coloured bodies, or contact surfaces seen through them."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field
from typing import Any

import numpy as np
import pyvista as pv

from fenics_contact.contact import State, Status, in_space
from fenics_contact.scene import ContactPair
from fenics_contact.viz.colours import GREY, INK, PALE, PRESSURE_MAP, STRESS_MAP
from fenics_contact.viz.decomposition import subdomain_layers
from fenics_contact.viz.fields import Bodies, contact_places, lengths, nodal
from fenics_contact.viz.stage import Layer, balls
from fenics_contact.viz.stress import stress_range
from fenics_contact.viz.symbols import symbols_of
from fenics_contact.viz.units import Units
from fenics_contact.viz.words import written

#: Radius of the balls on contact points and length of the longest arrow, relative to the side of a square of
#: the mean nodal area.
BALL, ARROW = 0.22, 1.5
_EDGES = {"show_edges": True, "edge_color": INK, "edge_opacity": 0.25, "line_width": 1}
_LIGHT = {"ambient": 0.5, "diffuse": 0.55}
_BAR = {"vertical": True, "position_x": 0.87, "position_y": 0.15, "height": 0.7, "width": 0.05}


@dataclass(frozen=True)
class Content:
    """The layers of a scene and their description.

    Attributes:
        layers: Layers to draw.
        facts: Text for the title.
        legend: Names and their colours.
    """

    layers: list[Layer]
    facts: str
    legend: Mapping[str, str] = field(default_factory=dict)


@dataclass(frozen=True)
class Subject:
    """The data from which a scene for the browser is built.

    Attributes:
        state: The state.
        bodies: Its deformed bodies for drawing.
        clim: Range of the colours, None to choose it.
        units: Names of the units.
    """

    state: State
    bodies: Bodies
    clim: tuple[float, float] | None
    units: Units


def stress_content(subject: Subject) -> Content:
    """Von Mises stress on the bodies."""
    peak = max(float(body["von_mises"].max()) for body in subject.bodies.values())
    unit, clim = subject.units.stress, subject.clim or stress_range(subject.bodies)
    values = {name: nodal(body, "von_mises") for name, body in subject.bodies.items()}
    layers = _coloured(subject, values, {"cmap": STRESS_MAP, "clim": clim}, f"von Mises stress ({unit})")
    return Content(layers, f"von Mises stress, largest mean over a cell {written(peak)} {unit}")


def displacement_content(subject: Subject) -> Content:
    """Magnitude of the displacement on the bodies."""
    values = {name: lengths(body) for name, body in subject.bodies.items()}
    peak, unit = max(float(length.max()) for length in values.values()), subject.units.length
    look = {"cmap": PRESSURE_MAP, "clim": subject.clim or (0.0, peak or 1.0)}
    layers = _coloured(subject, values, look, f"displacement ({unit})")
    return Content(layers, f"displacement, largest {written(peak)} {unit}")


def subdomain_content(subject: Subject) -> Content:
    """Subdomains, neighbours in different colours."""
    layers, count = [], 0
    for family, body in enumerate(subject.bodies.values()):
        _, part = np.unique(body["subdomain"], return_inverse=True)
        layers += subdomain_layers(body, part, family)
        count += int(part.max()) + 1
    return Content(layers, f"{count} subdomain{'s' if count != 1 else ''}")


def pressure_content(subject: Subject) -> Content:
    """Contact pressure on the slave surfaces, seen through the bodies."""
    peak = float(subject.state.contact.pressure.max())
    label = f"contact pressure ({subject.units.stress})"
    look = {"cmap": PRESSURE_MAP, "clim": subject.clim or (0.0, peak or 1.0), "scalars": "contact_pressure"}
    layers = _glass(subject)
    for number, pair in enumerate(subject.state.scene.contacts):
        options = {**look, **_bar(label, number == 0), "lighting": False, "line_width": 8}
        layers.append(Layer(_slave_surface(subject, pair), options))
    return Content(layers, f"contact pressure, largest {written(peak)} {subject.units.stress}")


def status_content(subject: Subject) -> Content:
    """Status of contact points, seen through the bodies, with arrows where they slip."""
    contact, layers, legend = subject.state.contact, _glass(subject), {}
    places = in_space(contact_places(subject.state, subject.bodies))
    dim = contact.points.normal.shape[1]
    side = float(contact.points.area.mean()) ** (1 / (dim - 1))
    for pair in subject.state.scene.contacts:
        layers.append(Layer(_slave_surface(subject, pair), {"color": PALE, "line_width": 4, **_LIGHT}))
    rubs = np.array([pair.has_friction for pair in subject.state.scene.contacts])[contact.points.pair]
    for kind in (True, False):
        for status, (name, symbol) in symbols_of(kind).items():
            chosen = (contact.status == status) & (rubs == kind)
            if np.any(chosen):
                colour = GREY if status == Status.OPEN else symbol["facecolors"]
                size = BALL * side / (2 if status == Status.OPEN else 1)
                layers.append(Layer(balls(places[chosen], size), {"color": colour, **_LIGHT}))
                legend[name] = colour
    slips = (contact.status == Status.SLIP) & rubs
    slip = in_space(contact.slip_in_space)
    longest = float(np.linalg.norm(slip[slips], axis=1).max(initial=0.0))
    if longest > 0:
        arrows = pv.PolyData(places[slips])
        arrows.point_data["slip"] = slip[slips] * (ARROW * side / longest)
        layers.append(Layer(arrows.glyph(orient="slip", scale="slip", geom=pv.Arrow()), {"color": INK}))
    counts = ", ".join(f"{contact.count(status)} {status.name.lower()}" for status in Status)
    moved = f"; largest slip {written(longest, 2)} {subject.units.length}" if longest > 0 else ""
    return Content(layers, f"contact status: {counts}{moved}", legend)


CONTENTS = {
    "von_mises": stress_content,
    "displacement": displacement_content,
    "contact_pressure": pressure_content,
    "contact_status": status_content,
    "subdomain": subdomain_content,
}


def _coloured(
    subject: Subject, values: Mapping[str, np.ndarray], look: dict[str, Any], label: str
) -> list[Layer]:
    layers = []
    for number, (name, body) in enumerate(subject.bodies.items()):
        skin = body.copy(deep=False)
        skin.point_data["shown"] = values[name]
        options = {"scalars": "shown", **look, **_EDGES, **_LIGHT, **_bar(label, number == 0)}
        layers.append(Layer(skin.extract_surface(algorithm=None), options))
    return layers


def _bar(label: str, shown: bool) -> dict[str, Any]:
    """A common bar: pyvista makes one for each title."""
    return {"show_scalar_bar": shown, "scalar_bar_args": {"title": label, **_BAR}}


def _glass(subject: Subject) -> list[Layer]:
    look = {"color": PALE, "opacity": 0.12, **_LIGHT}
    return [Layer(body.extract_surface(algorithm=None), look) for body in subject.bodies.values()]


def _slave_surface(subject: Subject, pair: ContactPair) -> pv.UnstructuredGrid:
    """Return the facets of a slave surface with the fields of its body's nodes."""
    facets, body = subject.state.scene.facets(pair.slave), subject.bodies[pair.slave.body]
    kind = {2: pv.CellType.LINE, 3: pv.CellType.TRIANGLE, 4: pv.CellType.QUAD}[facets.shape[1]]
    surface = pv.UnstructuredGrid({kind: facets}, body.points)
    surface.point_data.update(body.point_data)
    return surface
