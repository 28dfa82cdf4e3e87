"""A field on all bodies, ready for drawing: values, colours and labels."""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from dataclasses import dataclass
from typing import Any

import numpy as np
import pyvista as pv
from matplotlib.axes import Axes
from matplotlib.cm import ScalarMappable
from matplotlib.colors import Colormap, Normalize
from matplotlib.figure import Figure

from fenics_contact.viz.sheet import add_colour_bar
from fenics_contact.viz.units import Units


@dataclass(frozen=True)
class Paints:
    """The content of a picture of a field, apart from the bodies.

    Attributes:
        values: Body name -> values on its nodes or its cells.
        colours: Colour map.
        norm: From values to colours.
        label: Label of the colour bar, with the unit.
        headline: The title.
        scale: Factor of the displacement in the main picture.
        reach: Extent of details to each side of the contact's centre, [length], or None.
        units: Names of the units.
        width: Width of the picture in pixels.
        told: Whether the title names the largest value.
    """

    values: Mapping[str, np.ndarray]
    colours: Colormap
    norm: Normalize
    label: str
    headline: str
    scale: float
    reach: float | None
    units: Units
    width: int
    told: bool = False

    def shown(self, body: str) -> np.ndarray:
        """Return the values of a body scaled to 0 to 1, the range of the colours."""
        return np.ma.filled(self.norm(self.values[body], clip=False), 0.0)

    def on(self, bodies: Mapping[str, pv.UnstructuredGrid]) -> dict[str, pv.UnstructuredGrid]:
        """Return the bodies with the field ``shown``."""
        painted = {}
        for name, body in bodies.items():
            painted[name], shown = body.copy(deep=False), self.shown(name)
            data = painted[name].point_data if len(shown) == body.n_points else painted[name].cell_data
            data["shown"] = shown
        return painted

    def add_bar(self, figure: Figure, panels: Iterable[Axes]) -> None:
        """Add a colour bar beside axes; its ends are pointed where values lie beyond, and say how far."""
        low = min(float(values.min()) for values in self.values.values())
        high = max(float(values.max()) for values in self.values.values())
        key = ScalarMappable(self.norm, self.colours)
        add_colour_bar(figure, panels, key, self.label, beyond=(low, high), told=self.told)

    @property
    def of_surfaces(self) -> dict[str, Any]:
        """Keywords of pyvista's ``add_mesh`` for `shown`."""
        return {"scalars": "shown", "cmap": self.colours, "clim": (0.0, 1.0), "n_colors": 256}

    @property
    def of_cells(self) -> dict[str, Any]:
        """Keywords of matplotlib for `shown`."""
        return {"cmap": self.colours, "vmin": 0.0, "vmax": 1.0}
