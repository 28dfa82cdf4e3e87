"""A state to turn and zoom in a browser."""

from __future__ import annotations

import logging
from collections.abc import Mapping
from pathlib import Path
from typing import Any, TypeAlias

import numpy as np
from matplotlib.colors import Normalize

from fenics_contact.checkpoint import put_whole
from fenics_contact.contact import State
from fenics_contact.errors import InvalidInputError, MissingRequirementError, tell, together
from fenics_contact.viz.browser import InteractiveScene, captioned, exported, html_path, see_in_perspective
from fenics_contact.viz.colours import PRESSURE_MAP
from fenics_contact.viz.decomposition import plot_decomposition
from fenics_contact.viz.fields import drawn_bodies, lengths, moved, points_of
from fenics_contact.viz.interactive_layers import CONTENTS, Subject
from fenics_contact.viz.obstacles import obstacle_layers
from fenics_contact.viz.painting import paint
from fenics_contact.viz.paints import Paints
from fenics_contact.viz.picture import Picture
from fenics_contact.viz.pressure import plot_contact_pressure
from fenics_contact.viz.stage import staged
from fenics_contact.viz.stress import plot_stress
from fenics_contact.viz.units import Units
from fenics_contact.viz.view import IN_PLANE, frame_around, oblique_view
from fenics_contact.viz.words import checked_range, headline

logger = logging.getLogger(__name__)

#: Pixels for which camera and colour bar are set up; a browser shows them larger or smaller.
SIZE = (1000, 600)
#: Room around the bodies for title and colour bar, relative to their size.
MARGIN = 0.15

#: Range of the colours, title, units.
Look: TypeAlias = tuple[tuple[float, float] | None, str, Units]


def interactive(
    state: State,
    field: str = "von_mises",
    *,
    deformed: float = 1.0,
    path: str | Path | None = None,
    clim: tuple[float, float] | None = None,
    title: str = "",
    units: Units | None = None,
) -> InteractiveScene | Picture:
    """Show a state that the mouse turns, shifts and zooms. Collective.

    The scene is one page of HTML that works in notebooks, in pages made of them and as a file in any
    browser, without a server or a network. Fields of the contact are shown on the slave surfaces through
    bodies of glass. Where the libraries that make such pages are not installed, it is the static picture.

    Args:
        state: The state.
        field: "von_mises", "displacement", "contact_pressure", "contact_status" or "subdomain".
        deformed: Factor of the displacement.
        path: HTML file to write, None to write none.
        clim: Range of the colours; chosen unless given.
        title: What comes before the facts in the title.
        units: Names of the units, mm, N and MPa unless given.

    Returns:
        The scene; a picture where the libraries that make it are missing and no file was asked for.

    Raises:
        InvalidInputError: If there is no such field, or an option cannot be used.
        MissingRequirementError: If this machine cannot render, or a file is asked for and the libraries are
            missing.
    """
    target = html_path(path)
    _check(state, field, deformed)
    given = None if clim is None else checked_range(clim)
    bodies = drawn_bodies(state)
    subject = Subject(state, moved(bodies, float(deformed)), given, units or Units())
    comm = state.torn.decomposition.comm
    page, missing = None, None
    with together(comm):
        if comm.rank == 0:
            page, missing = _page(subject, field, title, deformed)
            if page is not None and target is not None:
                put_whole(target, page.encode())
    missing = comm.bcast(missing)
    if missing is None:
        return InteractiveScene(page, target)
    remedy = "pip install 'fenics_contact[notebooks]'"
    if target is not None:
        raise MissingRequirementError(f"scenes for a browser need {missing}: {remedy}", name="trame")
    if comm.rank == 0:
        tell(logger.info, "the picture is static, turning it needs %s: %s", missing, remedy)
    return _static(state, bodies, field, float(deformed), (given, title, subject.units))


def _check(state: State, field: str, deformed: float) -> None:
    if field not in CONTENTS:
        raise InvalidInputError(
            f"field must be one of {', '.join(CONTENTS)}, got {field!r}: choose one of them"
        )
    if field.startswith("contact") and not len(state.contact.status):
        raise InvalidInputError(
            f"the field {field!r} needs a scene with contact, got one without: show 'von_mises' or "
            "'displacement'"
        )
    if not np.isfinite(deformed):
        raise InvalidInputError(
            f"deformed must be finite, got {deformed}: give the factor of the displacement, such as 1"
        )


def _page(subject: Subject, field: str, title: str, deformed: float) -> tuple[str | None, str | None]:
    """Return the page, or what is missing to make it."""
    content, points = CONTENTS[field](subject), points_of(subject.bodies)
    space = subject.state.scene.dim == 3
    view = oblique_view(points) if space else IN_PLANE
    layers, corners = content.layers, np.zeros((0, 3))
    if space:
        obstacles, corners = obstacle_layers(subject.state.scene, points, view)
        layers = [*obstacles, *layers]
    frame = frame_around(view, np.concatenate([points, corners]), MARGIN)
    words = f"{headline(title, content.facts)}; deformation × {deformed:g}"
    with staged(layers, view, frame, SIZE) as plotter:
        see_in_perspective(plotter.camera, frame, SIZE)
        try:
            return captioned(exported(plotter), words, content.legend), None
        except ImportError as error:
            return None, f"pyvista[jupyter], got {error}"


def _static(state: State, bodies: Mapping[str, Any], field: str, deformed: float, look: Look) -> Picture:
    """Draw the same field without a browser. Collective."""
    clim, title, units = look
    if field == "von_mises":
        return plot_stress(state, clim=clim, scale=deformed, title=title, units=units)
    if field == "subdomain":
        decomposition = state.torn.decomposition
        return plot_decomposition(state.scene, decomposition.partitions, comm=decomposition.comm)
    if field.startswith("contact"):
        return plot_contact_pressure(state, clim=clim, title=title, units=units)
    values = {name: lengths(body) for name, body in bodies.items()}
    norm = Normalize(*(clim or (0.0, max(float(length.max()) for length in values.values()) or 1.0)))
    label, words = f"displacement ({units.length})", headline(title, f"displacement, × {deformed:g}")
    paints = Paints(values, PRESSURE_MAP, norm, label, words, deformed, None, units, 1600)
    return paint(state, bodies, paints, None, sections=False)
