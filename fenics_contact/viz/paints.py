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
        reach: Extent of details to each side of the contact's centre, [length], or None.
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

    def on(self, bodies: Mapping[str, pv.UnstructuredGrid]) -> dict[str, pv.UnstructuredGrid]:
        """Return the bodies with the field ``shown``, the values in terms of the colours, 0 to 1."""
        painted = {}
        for name, body in bodies.items():
            shown = np.ma.filled(self.norm(self.values[name], clip=False), 0.0)
            painted[name] = body.copy(deep=False)
            data = painted[name].point_data if len(shown) == body.n_points else painted[name].cell_data
            data["shown"] = shown
        return painted

    def add_bar(self, figure: Figure, panels: Iterable[Axes]) -> None:
        """Add a colour bar beside axes; its ends are pointed where values lie beyond, and say how far."""
        low = min(float(np.nanmin(values)) for values in self.values.values())
        high = max(float(np.nanmax(values)) for values in self.values.values())
        key = ScalarMappable(self.norm, self.colours)
        add_colour_bar(figure, panels, key, self.label, beyond=(low, high))

    @property
    def of_surfaces(self) -> dict[str, Any]:
        """Keywords of pyvista's ``add_mesh`` for the field ``shown``."""
        return {"scalars": "shown", "cmap": self.colours, "clim": (0.0, 1.0), "n_colors": 256}
