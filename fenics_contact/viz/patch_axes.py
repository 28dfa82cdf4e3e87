"""Axes for views along coordinates, and the bar of the pressure."""

from __future__ import annotations

from matplotlib.axes import Axes
from matplotlib.cm import ScalarMappable
from matplotlib.colors import Normalize
from matplotlib.ticker import FuncFormatter

from fenics_contact.viz.colours import PRESSURE_MAP
from fenics_contact.viz.patch import ContactPatch
from fenics_contact.viz.units import Units
from fenics_contact.viz.view import View, axis_label


def label_axes(axes: Axes, view: View, units: Units, *, mirror: bool = False) -> None:
    """Label the axes of a view, a reversed one with decreasing numbers and the viewing side, or mirrored."""
    for axis, direction, word, back in (
        (axes.xaxis, view.right, "right", "to the left"),
        (axes.yaxis, view.up, "up", "down"),
    ):
        name = axis_label(direction)
        label = f"{name.strip('−') or word} ({units.length})"
        if name.startswith("−"):
            axis.set_major_formatter(FuncFormatter(lambda value, _: f"{0 - value:g}".replace("-", "−")))
            if mirror and axis is axes.xaxis:
                axes.invert_xaxis()
            else:
                seen = axis_label(view.towards)
                label += f", runs {back}" + (f": seen from {seen}" if seen else "")
        axis.set_label_text(label)


def label_patch(axes: Axes, patch: ContactPatch, units: Units, *, mirror: bool = False) -> None:
    """Show the frame of a contact surface with equal scales, and name its axes; see `label_axes`."""
    patch.frame.fit(axes)
    if patch.unrolling is None:
        label_axes(axes, patch.view, units, mirror=mirror)
    else:
        across, along = patch.unrolling.labels(units)
        axes.set(xlabel=across, ylabel=along)


def pressure_bar(axes: Axes, clim: tuple[float, float], extend: str, units: Units) -> None:
    """Add a colour bar beside axes, of the same height."""
    key, label = ScalarMappable(Normalize(*clim), PRESSURE_MAP), f"contact pressure ({units.stress})"
    place = axes.inset_axes((1.03, 0.0, 0.04, 1.0))
    axes.figure.colorbar(key, cax=place, label=label, extend=extend)
