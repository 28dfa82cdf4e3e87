"""Axes for a projected contact surface."""

from __future__ import annotations

from matplotlib.axes import Axes
from matplotlib.axis import Axis
from matplotlib.cm import ScalarMappable
from matplotlib.colors import Normalize
from matplotlib.ticker import FuncFormatter

from fenics_contact.viz.colours import PRESSURE_MAP
from fenics_contact.viz.patch import ContactPatch
from fenics_contact.viz.units import Units
from fenics_contact.viz.view import axis_label


def label_axes(axes: Axes, patch: ContactPatch, units: Units, *, from_slave: bool = False) -> None:
    """Show the patch's window with equal scales; an axis that runs backwards counts backwards.

    Args:
        axes: What to label.
        patch: The surface.
        units: Names of the units.
        from_slave: Mirror it, as seen from inside the slave, if the axis then runs forwards.
    """
    patch.frame.fit(axes)
    for axis, direction, word in ((axes.xaxis, patch.view.right, "right"), (axes.yaxis, patch.view.up, "up")):
        name = axis_label(direction)
        label_axis(axis, name, word, units)
        if name.startswith("−") and from_slave and axis is axes.xaxis:
            axes.invert_xaxis()


def pressure_bar(axes: Axes, clim: tuple[float, float], extend: str, units: Units) -> None:
    """Add a colour bar beside axes, of the same height."""
    key, label = ScalarMappable(Normalize(*clim), PRESSURE_MAP), f"contact pressure ({units.stress})"
    place = axes.inset_axes((1.03, 0.0, 0.04, 1.0))
    axes.figure.colorbar(key, cax=place, label=label, extend=extend)


def label_axis(axis: Axis, name: str, word: str, units: Units) -> None:
    """Name an axis; one that runs backwards counts backwards.

    Args:
        axis: The axis.
        name: What `axis_label` returns: "x", "−x" or "".
        word: Name for an axis that runs along no coordinate.
        units: Names of the units.
    """
    axis.set_label_text(f"{name.strip('−') or word} ({units.length})")
    if name.startswith("−"):
        axis.set_major_formatter(FuncFormatter(lambda value, _: f"{0 - value:g}".replace("-", "−")))
