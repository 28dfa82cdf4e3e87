"""Picture of the result of an optimisation: contact before and after, and the moved outlines."""

from __future__ import annotations

from dataclasses import dataclass, replace
from pathlib import Path
from typing import BinaryIO

import numpy as np
from matplotlib.axes import Axes
from matplotlib.collections import LineCollection

from fenics_contact.contact import State
from fenics_contact.errors import InvalidInputError
from fenics_contact.shape import DesignPoint
from fenics_contact.viz.colours import BLUE, GREY, INK, ORANGE
from fenics_contact.viz.patch import checked_pair, contact_patches
from fenics_contact.viz.patch_axes import label_axes, label_patch, pressure_bar
from fenics_contact.viz.picture import Picture, draw_picture, png_path
from fenics_contact.viz.pressure import draw_pressure
from fenics_contact.viz.profile import Profile, profiles
from fenics_contact.viz.sheet import sheet
from fenics_contact.viz.trace import contact_trace
from fenics_contact.viz.units import Units
from fenics_contact.viz.view import Frame
from fenics_contact.viz.words import change, checked_range, checked_reach, headline, written


@dataclass(frozen=True)
class _Look:
    pair: int
    clim: tuple[float, float] | None
    reach: float | None
    headline: str
    units: Units
    width: int


def plot_before_after(
    first: State | DesignPoint,
    best: State | DesignPoint,
    path: str | Path | None = None,
    *,
    pair: int = 0,
    clim: tuple[float, float] | None = None,
    reach: float | None = None,
    label: str = "objective",
    title: str = "",
    units: Units | None = None,
    width: int = 1600,
) -> Picture:
    """Draw contact pressure before and after in the same colours, and the movement of outlines. Collective.

    The outlines are those of the undeformed bodies around the strongest contact: in space in two sections, in
    the plane directly; those after in true scale, and with their movement magnified by a stated factor. The
    title reports the decrease of the objective, if design points are given, and by how much the seat of the
    slave receded: the distance that the unloaded slave may travel along its contact force until it touches.

    Args:
        first: State before, or the design point, for instance ``problem.first``.
        best: State after, or the design point, for instance ``problem.best``.
        path: PNG file to write, None to write none.
        pair: Number of the contact pair in the scene.
        clim: Range of the pressure, [force / length²]; from zero to the largest of both unless given.
        reach: How far pictures reach around the contact's middle, [length]; chosen unless given.
        label: Name of the objective with its unit.
        title: Text before the facts in the title.
        units: Names of the units, mm, N and MPa unless given.
        width: Width of the picture in pixels.

    Returns:
        The picture, which can be used like a path to its file.

    Raises:
        InvalidInputError: If the two do not belong to the same scene, it has no such pair, nothing touches
            before, or an option cannot be used.
    """
    target = png_path(path)
    before, after = (point.state if isinstance(point, DesignPoint) else point for point in (first, best))
    _check(before, after, pair)
    checked_reach(reach)
    given = None if clim is None else checked_range(clim)
    named = units or Units()
    contacts = before.contact, after.contact
    peaks = [float(contact.pressure[contact.on_pair(pair)].max(initial=0.0)) for contact in contacts]
    values = [each.value for each in (first, best) if isinstance(each, DesignPoint)]
    facts = [f"{label} {change(*values)}"] if len(values) == 2 else []
    if len(values) < 2 or not np.allclose(values, peaks, rtol=1e-6):
        facts.append(f"largest pressure {written(peaks[0])} → {written(peaks[1])} {named.stress}")
    facts.append(f"seat gives way by {written(_retreat(before, after, pair), 2)} {named.length}")
    look = _Look(pair, given, reach, headline(title, "; ".join(facts)), named, width)
    draw = _draw_in_plane if before.scene.dim == 2 else _draw_in_space
    comm = before.torn.decomposition.comm
    return draw_picture(comm, target, lambda paper: draw(before, after, paper, look))


def _retreat(first: State, best: State, pair: int) -> float:
    """Return how much farther the slave may travel against the contact force; 0 where it is rounding."""
    resultant = first.contact.force[first.contact.on_pair(pair)].sum(axis=0)
    way = -resultant / np.linalg.norm(resultant)
    found = best.contact.travel(way, pair) - first.contact.travel(way, pair)
    return 0.0 if abs(found) < 1e-9 * float(np.ptp(first.scene.points)) else found


def _check(first: State, best: State, pair: int) -> None:
    cells = [
        {name: body.mesh.cells.shape for name, body in state.scene.bodies.items()} for state in (first, best)
    ]
    if cells[0] != cells[1]:
        raise InvalidInputError(
            f"before and after must have the same bodies and cells, got {cells[0]} and {cells[1]}: give two "
            "designs of one scene"
        )
    checked_pair(first, pair)
    if not np.any(first.contact.normal_force > 0):
        raise InvalidInputError(
            "a picture of before and after needs contact forces before, got none: draw with plot_stress"
        )


def _draw_in_space(first: State, best: State, paper: BinaryIO, look: _Look) -> None:
    patches = contact_patches((first, best), look.pair, look.reach)
    (one, other), peak = (
        (patch.frame for patch in patches),
        max(float(patch.pressure.max()) for patch in patches),
    )
    frame = Frame(np.minimum(one.low, other.low), np.maximum(one.high, other.high))
    shown = look.clim or (0.0, peak or 1.0)
    outlines = profiles(first, best, look.reach, look.units.length)
    # Sections have equal heights and together the width of the picture, but a limited height.
    wide = [profile.frame.proportion for profile in outlines]
    tall = [0.4 / frame.proportion + 0.08, min(0.8 / sum(wide), 0.45) + 0.13]
    size = look.width, round((sum(tall) + 0.03) * look.width)
    with sheet(paper, size, look.headline) as figure:
        upper, lower = figure.subfigures(2, 1, height_ratios=tall)
        panels = upper.subplots(1, 2)
        for axes, patch, word in zip(panels, patches, ("before", "after"), strict=True):
            draw_pressure(axes, patch, shown)
            axes.set_title(f"{word}: pressure on {patch.name}{patch.behind}")
            label_patch(axes, replace(patch, frame=frame), look.units)
        pressure_bar(panels[1], shown, "max" if peak > shown[1] else "neither", look.units)
        sections = lower.subplots(1, len(outlines), width_ratios=wide)
        for axes, profile in zip(sections, outlines, strict=True):
            _draw_profile(axes, profile, min(profile.factor for profile in outlines), look.units)
        lower.legend(*sections[0].get_legend_handles_labels(), loc="outside lower center", ncols=3)


def _draw_in_plane(first: State, best: State, paper: BinaryIO, look: _Look) -> None:
    traces = [contact_trace(state, look.pair) for state in (first, best)]
    (profile,) = profiles(first, best, look.reach, look.units.length)
    with sheet(paper, (look.width, round(0.5 * look.width)), look.headline) as figure:
        left, right = figure.subplots(1, 2)
        for trace, word, colour, line in zip(
            traces, ("before", "after"), (GREY, ORANGE), ("--", "-"), strict=True
        ):
            left.plot(
                trace.broken(trace.places),
                trace.broken(trace.pressure),
                line,
                color=colour,
                lw=2.2,
                label=word,
            )
        ends = [end for trace in traces for end in trace.window(look.reach)]
        top = max(float(trace.pressure.max()) for trace in traces) or 1.0
        left.set(xlim=(min(ends), max(ends)), ylim=look.clim or (-0.03 * top, 1.08 * top))
        words = f"{traces[0].axis} ({look.units.length})", f"contact pressure ({look.units.stress})"
        left.set(xlabel=words[0], ylabel=words[1], title=f"pressure on {traces[0].name}")
        left.grid(color=GREY, alpha=0.25)
        left.legend(loc="upper right")
        _draw_profile(right, profile, profile.factor, look.units)
        right.legend(loc="upper center", bbox_to_anchor=(0.5, -0.14), ncols=3)


def _draw_profile(axes: Axes, profile: Profile, factor: float, units: Units) -> None:
    drawn = [("before", 0.0, GREY, 3.5), (f"after, movement × {factor:g}", factor, ORANGE, 1.6)]
    if factor > 1.0:
        drawn.append(("after", 1.0, INK, 0.8))
    for number, (name, lines) in enumerate(profile.before.items()):
        for word, by, colour, width in drawn:
            moved, label = lines + by * profile.moves[name], None if number else word
            axes.add_collection(LineCollection(moved, colors=colour, linewidths=width, label=label))
        place = profile.place_in(name)
        if place is not None:
            axes.text(*place, name, color=BLUE, ha="center", va="center")
    profile.frame.fit(axes)
    label_axes(axes, profile.view, units)
    largest = f"{written(profile.largest, 2)} {units.length}"
    axes.set_title(f"{profile.title}\nmoved by up to {largest}")
