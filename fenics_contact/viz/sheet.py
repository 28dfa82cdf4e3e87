"""The sheet: a matplotlib figure with common fonts, with images and scale bars on it."""

from __future__ import annotations

from collections.abc import Iterable, Iterator
from contextlib import contextmanager
from typing import Any, BinaryIO

import matplotlib as mpl
import numpy as np
from matplotlib.axes import Axes
from matplotlib.backends.backend_agg import FigureCanvasAgg
from matplotlib.cm import ScalarMappable
from matplotlib.figure import Figure
from mpl_toolkits.axes_grid1.anchored_artists import AnchoredSizeBar

from fenics_contact.viz.colours import INK
from fenics_contact.viz.view import Frame
from fenics_contact.viz.words import nice_number, written

#: Width of every sheet in inches: fonts and lines scale with the number of pixels.
INCHES = 16.0
#: Size of the title, and its largest width relative to the sheet.
HEADLINE, WIDEST = 18, 0.97

#: Where the tip of a colour bar ends, relative to the bar's length.
TIP = 0.06

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


def show_image(axes: Axes, image: np.ndarray, frame: Frame, title: str = "") -> None:
    """Show an image of a frame's content, in the frame's coordinates, without axes."""
    (left, low), (right, high) = frame.low, frame.high
    axes.imshow(image, extent=(left, right, low, high))
    axes.set_axis_off()
    axes.set_title(title)


def add_colour_bar(
    figure: Figure,
    panels: Iterable[Axes],
    key: ScalarMappable,
    label: str,
    *,
    beyond: tuple[float, float] | None = None,
    told: bool = False,
) -> None:
    """Draw a colour bar to the right of panels without moving them.

    Args:
        figure: Where to.
        panels: What it belongs to.
        key: From values to colours.
        label: Its label, with the unit.
        beyond: Smallest and largest value: where they lie beyond the colours the bar ends in a tip, beside
            which they are written.
        told: Whether the largest value stands elsewhere.
    """
    low, high = beyond or key.get_clim()
    out = low < key.norm.vmin, high > key.norm.vmax
    extend = {(False, False): "neither", (True, False): "min", (False, True): "max"}.get(out, "both")
    place = {"label": label, "aspect": 30, "shrink": 0.95, "panchor": False}
    bar = figure.colorbar(key, ax=panels, extend=extend, **place)
    for is_out, words, end, side in (
        (out[0], f"smallest {written(low, 3)}", -TIP, "top"),
        (out[1] and not told, f"largest {written(high, 3)}", 1 + TIP, "bottom"),
    ):
        if is_out:
            bar.ax.text(0.5, end, words, transform=bar.ax.transAxes, ha="center", va=side)


def scale_bar(axes: Axes, frame: Frame, unit: str, *, below: bool = False) -> None:
    """Draw a scale bar of round length in the lower left corner of axes that show a frame, or below them."""
    length = nice_number(float(frame.size[0]) / 3)
    words, height = f"{written(length, 1)} {unit}", 0.012 * float(frame.size[1])
    look: dict[str, Any] = {"label_top": True, "color": INK, "size_vertical": height, "pad": 0.4, "sep": 4}
    if below:
        look |= {"size_vertical": 0.006 * float(frame.size[0]), "bbox_transform": axes.transAxes}
        look["bbox_to_anchor"] = (0.0, 0.0)
    bar = AnchoredSizeBar(axes.transData, length, words, "upper left" if below else "lower left", **look)
    bar.patch.set(facecolor="white", edgecolor="none", alpha=0.75)
    axes.add_artist(bar)
