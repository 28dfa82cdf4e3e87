"""Picture of a plane contact surface: pressure, tangential traction and status along it."""

from __future__ import annotations

from typing import BinaryIO

import numpy as np
from matplotlib.axes import Axes
from matplotlib.ticker import MaxNLocator

from fenics_contact.contact import Status
from fenics_contact.viz.colours import BLUE, GREY, INK, ORANGE, PALE
from fenics_contact.viz.sheet import sheet
from fenics_contact.viz.symbols import symbols_of
from fenics_contact.viz.trace import ContactTrace
from fenics_contact.viz.units import Units
from fenics_contact.viz.words import headline, written

#: Length of the longest arrow, relative to the width, and the largest number of arrows.
ARROW, MOST_ARROWS = 0.03, 40


def draw_traction(
    trace: ContactTrace,
    paper: BinaryIO,
    window: tuple[tuple[float, float] | None, float | None],
    title: str,
    units: Units,
    width: int,
) -> None:
    """Draw the pressure above and, where friction acts, the tangential traction on the slave below.

    ``window`` holds the range of the pressure and the extent of the picture, None for automatic ones.
    """
    (clim, reach), rubs = window, trace.rubs
    facts = f"largest pressure {written(float(trace.pressure.max()))} {units.stress}, "
    facts += f"normal force {written(trace.force)} {units.force}/{units.length}"
    if rubs:
        facts += f", tangential force {written(trace.shear)} {units.force}/{units.length}"
    top = float(trace.pressure.max()) or 1.0
    height = round((0.62 if rubs else 0.4) * width)
    with sheet(paper, (width, height), headline(title, facts)) as figure:
        rows = figure.subplots(2 if rubs else 1, 1, sharex=True, squeeze=False)[:, 0]
        _curve(rows[0], trace, trace.pressure, BLUE)
        _symbols(rows[0], trace, trace.pressure)
        rows[0].set_ylabel(f"contact pressure ({units.stress})")
        rows[0].set_title(f"pressure on {trace.name}")
        rows[0].set_ylim(*(clim or (-0.05 * top, 1.08 * top)))
        if rubs:
            _draw_friction(rows[1], trace, units)
        rows[-1].set_xlabel(f"{trace.axis} ({units.length})")
        rows[-1].set_xlim(*trace.window(reach))
        for axes in rows:
            axes.grid(color=GREY, alpha=0.25)
            axes.yaxis.set_major_locator(MaxNLocator(6))
        handles, labels = rows[0].get_legend_handles_labels()
        figure.legend(handles, labels, loc="outside lower right", ncols=3, handletextpad=0.2)


def _draw_friction(axes: Axes, trace: ContactTrace, units: Units) -> None:
    places, bound = trace.broken(trace.places), trace.broken(trace.bound)
    axes.fill_between(places, -bound, bound, color=PALE, linewidth=0)
    for side in (-bound, bound):
        axes.plot(places, side, "--", color=INK, lw=1.2)
    _curve(axes, trace, trace.traction, ORANGE)
    _symbols(axes, trace, trace.traction)
    axes.axhline(0.0, color=INK, lw=0.8)
    axes.set_ylabel(f"tangential traction ({units.stress})")
    slips = trace.status == Status.SLIP
    longest = float(np.abs(trace.slip[slips]).max(initial=0.0))
    end = ", no slip"
    if longest > 0:
        _draw_slip(axes, trace, longest)
        end = f"; arrows: slip on the master, largest {written(longest, 2)} {units.length}"
    axes.set_title(f"tangential traction on the slave, slip bound dashed{end}")


def _draw_slip(axes: Axes, trace: ContactTrace, longest: float) -> None:
    """Draw slip by arrows, at a subset of the points if these are many."""
    low, high = trace.window(None)
    places = trace.places[trace.points]
    seen = np.flatnonzero((trace.status == Status.SLIP) & (places > low) & (places < high))
    seen = seen[np.argsort(places[seen])][:: -(-len(seen) // MOST_ARROWS)]
    lengths = ARROW * trace.slip[seen] / longest
    look = {"angles": "uv", "scale_units": "width", "scale": 1, "width": 0.0022, "minlength": 0.0}
    heights = trace.traction[trace.points[seen]]
    axes.quiver(places[seen], heights, lengths, 0 * lengths, color=INK, zorder=4, **look)


def _curve(axes: Axes, trace: ContactTrace, values: np.ndarray, colour: str) -> None:
    axes.plot(trace.broken(trace.places), trace.broken(values), color=colour, lw=1.8, zorder=2.5)


def _symbols(axes: Axes, trace: ContactTrace, values: np.ndarray) -> None:
    low, high = trace.window(None)
    seen = np.count_nonzero((trace.places > low) & (trace.places < high))
    size = float(np.clip(60 / max(seen, 1), 0.12, 0.6))
    for status, (name, look) in symbols_of(trace.rubs).items():
        chosen = trace.points[trace.status == status]
        axes.scatter(
            trace.places[chosen],
            values[chosen],
            label=f"{name} ({len(chosen)})",
            zorder=3,
            linewidths=0.6,
            **{**look, "s": size * look["s"]},
        )
