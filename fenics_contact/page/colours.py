"""Colours of a page: those of the pictures, as lists."""

from __future__ import annotations

import numpy as np
from matplotlib.colors import Colormap, to_hex

from fenics_contact.viz import BLUE, GREY, INK, ORANGE, PRESSURE_MAP, SIGNED_MAP, STRESS_MAP


def colour_scales() -> dict[str, list[list[float | str]] | list[str] | str]:
    """Return places from 0 to 1 and their colours for sizes and signed values, and single colours by use."""
    return {
        "size": _samples(STRESS_MAP),
        "contact": _samples(PRESSURE_MAP),
        "signed": _samples(SIGNED_MAP),
        "status": [GREY, BLUE, ORANGE],
        "line": INK,
        "obstacle": GREY,
    }


def _samples(colours: Colormap, count: int = 33) -> list[list[float | str]]:
    return [[float(place), to_hex(colours(float(place)))] for place in np.linspace(0.0, 1.0, count)]
