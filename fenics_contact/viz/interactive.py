"""An interactive view of a state in a browser."""

from __future__ import annotations

import logging
from collections.abc import Mapping
from io import BytesIO
from pathlib import Path

import numpy as np
import pyvista as pv

from fenics_contact.checkpoint import put_whole
from fenics_contact.contact import State
from fenics_contact.errors import InvalidInputError, MissingRequirementError, tell, together
from fenics_contact.viz.browser import InteractiveScene, captioned, exported
from fenics_contact.viz.fields import drawn_bodies, moved, points_of
from fenics_contact.viz.interactive_layers import CONTENTS, Subject
from fenics_contact.viz.obstacles import obstacle_layers
from fenics_contact.viz.picture import Picture, file_path
from fenics_contact.viz.sheet import sheet
from fenics_contact.viz.stage import staged
from fenics_contact.viz.units import Units
from fenics_contact.viz.view import IN_PLANE, frame_around, oblique_view
from fenics_contact.viz.words import checked_range, headline

logger = logging.getLogger(__name__)

#: Nominal size in pixels for camera and colour bar; a browser scales them.
SIZE = (1000, 600)


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
    """Show a state that the mouse rotates, shifts and zooms. Collective.

    The scene is a single HTML page that works in notebooks, in pages made from them and as a file in any
    browser, without a server or a network. Contact fields are shown on the slave surfaces through transparent
    bodies. Without the libraries for such pages, a static picture is returned.

    Args:
        state: The state.
        field: "von_mises", "displacement", "contact_pressure", "contact_status" or "subdomain".
        deformed: Factor of the displacement.
        path: HTML file to write, None to write none.
        clim: Range of the colours; chosen unless given.
        title: Text before the facts in the title.
        units: Names of the units, mm, N and MPa unless given.

    Returns:
        The scene; a picture if the libraries for it are missing and no file was requested.

    Raises:
        InvalidInputError: If there is no such field, or an option cannot be used.
        MissingRequirementError: If this machine cannot render, or a file is requested and the libraries are
            missing.
    """
    target = file_path(path, ".html", "interactive scenes are HTML files")
    _check(state, field, deformed)
    given = None if clim is None else checked_range(clim)
    subject = Subject(state, moved(drawn_bodies(state), float(deformed)), given, units or Units())
    comm = state.torn.decomposition.comm
    page, png, missing = None, None, None
    with together(comm):
        if comm.rank == 0:
            page, png, missing = _drawn(subject, field, title, deformed)
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
    return Picture(png)


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


def _drawn(
    subject: Subject, field: str, title: str, deformed: float
) -> tuple[str | None, bytes | None, str | None]:
    """Return the page, or a picture instead and the name of what is missing."""
    content, points = CONTENTS[field](subject), points_of(subject.bodies)
    space = subject.state.scene.dim == 3
    view = oblique_view(points) if space else IN_PLANE
    obstacles = obstacle_layers(subject.state, points, view)[0] if space else []
    words = f"{headline(title, content.facts)}; deformation × {deformed:g}"
    with staged([*obstacles, *content.layers], view, frame_around(view, points), SIZE) as plotter:
        plotter.disable_parallel_projection()  # the viewer knows none
        plotter.reset_camera(bounds=pv.PolyData(points).bounds)
        try:
            return captioned(exported(plotter), words, content.legend), None, None
        except ImportError as error:
            image = np.asarray(plotter.screenshot(None, return_img=True, scale=2))
            return None, _still(image, words, content.legend), f"pyvista[jupyter], got {error}"


def _still(image: np.ndarray, title: str, legend: Mapping[str, str]) -> bytes:
    """Return the PNG file of a picture with a legend: names and their colours."""
    paper = BytesIO()
    with sheet(paper, (1600, 1060), title) as figure:
        axes = figure.subplots()
        axes.imshow(image)
        axes.set_axis_off()
        for name, colour in legend.items():
            axes.scatter([], [], color=colour, label=name)
        if legend:
            figure.legend(loc="outside lower center", ncols=len(legend))
    return paper.getvalue()
