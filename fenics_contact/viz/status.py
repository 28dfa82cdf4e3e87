"""Maps of the status of contact points, one for each state of a history."""

from __future__ import annotations

from collections.abc import Mapping
from pathlib import Path
from typing import BinaryIO

import numpy as np
from matplotlib.axes import Axes
from matplotlib.collections import PolyCollection

from fenics_contact.contact import State
from fenics_contact.errors import InvalidInputError
from fenics_contact.viz.colours import INK, PALE
from fenics_contact.viz.patch import ContactPatch, contact_patches
from fenics_contact.viz.patch_axes import label_patch
from fenics_contact.viz.picture import Picture, draw_picture, png_path
from fenics_contact.viz.sheet import sheet
from fenics_contact.viz.symbols import symbols_of
from fenics_contact.viz.units import Units
from fenics_contact.viz.words import written

#: Length of the longest arrow, relative to the map.
ARROW = 0.07
#: Largest number of maps in a row.
COLUMNS = 3


def plot_contact_status(
    states: Mapping[str, State],
    path: str | Path | None = None,
    *,
    pair: int = 0,
    reach: float | None = None,
    title: str = "",
    units: Units | None = None,
    width: int = 1600,
) -> Picture:
    """Draw where a contact pair is open, sticks and slips, in one map for each state. Collective.

    Arrows show the slip on the master in the last load step. The surface is seen from the master's side, or
    from inside the slave if the axes then run to the right.

    Args:
        states: Name -> state of a scene in space, for instance after each load step.
        path: PNG file to write, None to write none.
        pair: Number of the contact pair in the scenes.
        reach: How far a map reaches around the contact's middle, [length]; chosen unless given.
        title: Title.
        units: Names of the units, mm, N and MPa unless given.
        width: Width of the picture in pixels.

    Returns:
        The picture, which can be used like a path to its file.

    Raises:
        InvalidInputError: If there is no state, one has no such pair, or one is plane.
    """
    target = png_path(path)
    if not states:
        raise InvalidInputError("maps of the status need a state, got none: pass {'name': state}")
    for name, state in states.items():
        if state.scene.dim == 2 or not 0 <= pair < len(state.scene.contacts):
            raise InvalidInputError(
                f"maps of the status need states in space with a contact pair {pair}, got {name!r} in "
                f"{state.scene.dim} dimensions, number of pairs {len(state.scene.contacts)}: "
                "plot_contact_pressure draws plane states"
            )
    comm = next(iter(states.values())).torn.decomposition.comm

    def draw(paper: BinaryIO) -> None:
        patches = dict(zip(states, contact_patches(list(states.values()), pair, reach), strict=True))
        _draw(patches, paper, title or next(iter(patches.values())).name, units or Units(), width)

    return draw_picture(comm, target, draw)


def _draw(patches: Mapping[str, ContactPatch], paper: BinaryIO, title: str, units: Units, width: int) -> None:
    columns = min(COLUMNS, len(patches))
    rows = -(-len(patches) // columns)
    proportion = next(iter(patches.values())).frame.proportion
    height = round((0.09 + rows * (0.09 + 0.9 / (proportion * columns))) * width)
    with sheet(paper, (width, height), title) as figure:
        panels = figure.subplots(rows, columns, sharex=True, sharey=True, squeeze=False).ravel()
        for axes, (name, patch) in zip(panels, patches.items(), strict=False):
            draw_status(axes, patch, counted=False)
            axes.set_title(_words(patch, units) if name == title else f"{name}\n{_words(patch, units)}")
            label_patch(axes, patch, units, mirror=True)
        for axes in panels[len(patches) :]:
            axes.set_axis_off()
        handles, labels = panels[0].get_legend_handles_labels()
        figure.legend(handles, labels, loc="outside lower right", ncols=3, handletextpad=0.2)


def _words(patch: ContactPatch, units: Units) -> str:
    longest, slips = patch.largest_slip, patch.slips
    share = f"{np.count_nonzero(slips)} of {len(slips)} slip"
    words = f"{share}, by up to {written(longest, 2)} {units.length}" if longest > 0 else "none slips"
    return words + patch.behind


def draw_status(axes: Axes, patch: ContactPatch, *, counted: bool = True) -> None:
    """Draw projected facets, a symbol on each contact point, and arrows for slip."""
    axes.add_collection(PolyCollection(patch.places[patch.facets], facecolors=PALE, edgecolors="white"))
    places = patch.places[patch.points]
    for status, (name, look) in symbols_of(patch.rubs).items():
        chosen = patch.status == status
        label = f"{name} ({np.count_nonzero(chosen)})" if counted else name
        axes.scatter(*places[chosen].T, label=label, zorder=3, linewidths=1.0, **look)
    longest = patch.largest_slip
    if longest > 0:
        # On wide strips arrows and their heads follow the height.
        slender = min(1.0, 3.0 / patch.frame.proportion)
        reach = ARROW * slender * float(np.max(patch.frame.size)) / longest
        arrows = {"angles": "xy", "scale_units": "xy", "scale": 1, "color": INK, "zorder": 4}
        arrows["width"] = 0.004 * slender
        # Short arrows stay arrows, as dots would hide the symbols.
        arrows |= {"minlength": 0.0}
        shown = patch.slips & patch.frame.holds(places)
        drawn = axes.quiver(*places[shown].T, *(reach * patch.slip[shown]).T, clip_on=False, **arrows)
        drawn.set_in_layout(False)  # its extent is not known before it is drawn
