"""Picture of a contact surface seen face on: pressure and status."""

from __future__ import annotations

from pathlib import Path
from typing import BinaryIO

from matplotlib.axes import Axes
from matplotlib.collections import PolyCollection

from fenics_contact.contact import State
from fenics_contact.viz.colours import GREY, PRESSURE_MAP
from fenics_contact.viz.patch import ContactPatch, checked_pair, contact_patches
from fenics_contact.viz.patch_axes import label_patch, pressure_bar
from fenics_contact.viz.picture import Picture, draw_picture, png_path
from fenics_contact.viz.plane import draw_field
from fenics_contact.viz.sheet import sheet
from fenics_contact.viz.status import draw_status
from fenics_contact.viz.trace import contact_trace
from fenics_contact.viz.traction import draw_traction
from fenics_contact.viz.units import Units
from fenics_contact.viz.words import checked_range, checked_reach, headline, written

#: Surfaces wider than this relative to their height are drawn one above the other.
WIDE = 2.5


def plot_contact_pressure(
    state: State,
    path: str | Path | None = None,
    *,
    pair: int = 0,
    clim: tuple[float, float] | None = None,
    reach: float | None = None,
    title: str = "",
    units: Units | None = None,
    width: int = 1600,
) -> Picture:
    """Draw a contact pair's slave surface seen from its master. Collective.

    Left, or above, the nodal pressure, then the status of the points with the direction of slip on the
    master. A surface around an axis that carries force on sides facing away, such as a bore, is unrolled; of
    others the title says how many closed points are not seen. For a plane scene the pressure along the slave
    surface, below it the tangential traction on the slave between its bounds, with the status of the points.

    Args:
        state: The state.
        path: PNG file to write, None to write none.
        pair: Number of the contact pair in the scene.
        clim: Range of the pressure, [force / length²]; from zero to the largest pressure unless given. Give
            two pictures the same range to compare them.
        reach: How far the picture reaches around the contact's middle, [length]; chosen unless given.
        title: Text before the facts in the title.
        units: Names of the units, mm, N and MPa unless given.
        width: Width of the picture in pixels.

    Returns:
        The picture, which can be used like a path to its file.

    Raises:
        InvalidInputError: If the scene has no such pair, or a range or the name of the file cannot be used.
    """
    target = png_path(path)
    checked_pair(state, pair)
    checked_reach(reach)
    given = None if clim is None else checked_range(clim)
    named = units or Units()

    def draw(paper: BinaryIO) -> None:
        if state.scene.dim == 2:
            draw_traction(contact_trace(state, pair), paper, (given, reach), title, named, width)
        else:
            _draw(contact_patches([state], pair, reach)[0], paper, given, title, named, width)

    return draw_picture(state.torn.decomposition.comm, target, draw)


def _draw(
    patch: ContactPatch,
    paper: BinaryIO,
    clim: tuple[float, float] | None,
    title: str,
    units: Units,
    width: int,
) -> None:
    peak = float(patch.pressure.max())
    shown = clim or (0.0, peak or 1.0)
    facts = (
        f"largest pressure {written(peak)} {units.stress}, normal force {written(patch.force)} {units.force}"
    )
    wide = patch.frame.proportion > WIDE
    tall = 0.24 + 1.76 / patch.frame.proportion if wide else 0.19 + 0.38 / patch.frame.proportion
    with sheet(paper, (width, round(tall * width)), headline(title, facts)) as figure:
        left, right = figure.subplots(*((2, 1) if wide else (1, 2)), sharex=True, sharey=True)
        draw_pressure(left, patch, shown)
        pressure_bar(left, shown, "max" if peak > shown[1] else "neither", units)
        draw_status(right, patch)
        longest = f"{written(patch.largest_slip, 2)} {units.length}"
        slip = f"largest slip {longest}" if patch.largest_slip > 0 else "no slip"
        right.set_title(f"status, {slip if patch.rubs else 'no friction'}{patch.behind}")
        for axes in (left, right):
            label_patch(axes, patch, units)
        (left.set_xlabel if wide else right.set_ylabel)("")
        handles, labels = right.get_legend_handles_labels()
        figure.legend(handles, labels, loc="outside lower right", ncols=3, handletextpad=0.2)


def draw_pressure(axes: Axes, patch: ContactPatch, clim: tuple[float, float]) -> None:
    """Draw the pressure on projected facets."""
    look = {"cmap": PRESSURE_MAP, "vmin": clim[0], "vmax": clim[1]}
    draw_field(axes, patch.places, patch.facets, patch.pressure, look)
    outlines = {"facecolors": "none", "edgecolors": GREY, "linewidths": 0.5}
    axes.add_collection(PolyCollection(patch.places[patch.facets], **outlines))
    axes.set_title(f"pressure on {patch.name}")
