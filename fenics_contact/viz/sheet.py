"""The sheet: a matplotlib figure with common fonts, with images and scale bars on it."""

from __future__ import annotations

from collections.abc import Iterable, Iterator
from contextlib import contextmanager
from typing import BinaryIO

import matplotlib as mpl
import numpy as np
from matplotlib.axes import Axes
from matplotlib.backends.backend_agg import FigureCanvasAgg
from matplotlib.cm import ScalarMappable
from matplotlib.figure import Figure

from fenics_contact.viz.colours import INK
from fenics_contact.viz.view import Frame
from fenics_contact.viz.words import written

#: Width of every sheet in inches: fonts and lines scale with the number of pixels.
INCHES = 16.0
#: Size of the title, and its largest width relative to the sheet.
HEADLINE, WIDEST = 18, 0.97


_STYLE = {
    "font.family": "sans-serif",
    "font.sans-serif": ["DejaVu Sans"],
    "font.size": 15,
    "axes.titlesize": 16,
    "axes.labelsize": 15,
    "axes.edgecolor": INK,
    "axes.labelcolor": INK,
    "axes.spines.top": False,
    "axes.spines.right": False,
    "text.color": INK,
    "xtick.color": INK,
    "ytick.color": INK,
    "legend.frameon": False,
    "figure.facecolor": "white",
    "savefig.facecolor": "white",
}


@contextmanager
def sheet(paper: BinaryIO, size: tuple[int, int], title: str) -> Iterator[Figure]:
    """Open an empty figure with automatic layout, and save it at the end.

    Args:
        paper: A file opened for bytes.
        size: Width and height in pixels.
        title: Title above everything.

    Yields:
        The figure.
    """
    dpi = size[0] / INCHES
    with mpl.rc_context({**mpl.rcParamsDefault, **_STYLE}):
        figure = Figure(figsize=(INCHES, size[1] / dpi), dpi=dpi, layout="constrained")
        FigureCanvasAgg(figure)
        figure.get_layout_engine().set(w_pad=0.12, h_pad=0.12)
        head = figure.suptitle(title, fontsize=HEADLINE, fontweight="bold")
        wide = float(head.get_window_extent().width) / (WIDEST * size[0])
        head.set_fontsize(HEADLINE / max(wide, 1.0))
        yield figure
        figure.savefig(paper, dpi=dpi, format="png")


def show_image(
    axes: Axes, image: np.ndarray, frame: Frame, title: str = "", *, coordinates: bool = False
) -> None:
    """Show an image of a frame's content, in the frame's coordinates, with or without these at the axes."""
    axes.imshow(image, extent=(frame.low[0], frame.high[0], frame.low[1], frame.high[1]))
    if not coordinates:
        axes.set_axis_off()
    axes.set_title(title)


def add_colour_bar(
    figure: Figure,
    panels: Iterable[Axes],
    key: ScalarMappable,
    label: str,
    *,
    beyond: tuple[float, float] | None = None,
) -> None:
    """Draw a colour bar to the right of panels; its ends are pointed where ``beyond`` exceeds the colours.

    ``beyond``, the smallest and largest value drawn, is written beside the label where it does.
    """
    low, high = beyond or key.get_clim()
    out = low < key.norm.vmin, high > key.norm.vmax
    extend = {(False, False): "neither", (True, False): "min", (False, True): "max"}.get(out, "both")
    ends = [f"smallest {written(low, 3)}"] * out[0] + [f"largest {written(high, 3)}"] * out[1]
    words = f"{label}; {', '.join(ends)}" if ends else label
    figure.colorbar(key, ax=panels, extend=extend, label=words, aspect=30, shrink=0.95, panchor=False)
