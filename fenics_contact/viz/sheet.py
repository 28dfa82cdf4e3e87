"""The sheet of paper: a matplotlib figure with the house's fonts, and its atomic way into a file."""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import contextmanager
from io import BytesIO
from pathlib import Path
from typing import Any, BinaryIO

import matplotlib as mpl
import numpy as np
from matplotlib.backends.backend_agg import FigureCanvasAgg
from matplotlib.figure import Figure

from fenics_contact.viz.colours import INK
from fenics_contact.viz.picture import png_path, write_file
from fenics_contact.viz.words import nice_number, written

#: Inches of every sheet's width: fonts and lines grow with the number of pixels.
INCHES = 16.0
#: Height of the band with the title, relative to the width of the sheet.
TITLE = 0.035
#: Size of the title, and the part of the width that it takes at most.
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
def sheet(
    paper: str | Path | BinaryIO, size: tuple[int, int], title: str, layout: str = "none"
) -> Iterator[Any]:
    """Open an empty figure and save it at the end, whole or not at all.

    Args:
        paper: PNG file to write, or a file opened for bytes. The folder of a path is created, and a file of
            that name is replaced when the new one is complete.
        size: Width and height in pixels.
        title: Title above everything, in a band of height ``TITLE`` times the width.
        layout: "constrained" to let matplotlib find room for axes and labels, "none" to place them by hand.

    Yields:
        A matplotlib Figure.

    Raises:
        InvalidInputError: If the name does not end in ".png".
    """
    path = png_path(paper) if isinstance(paper, str | Path) else None
    dpi = size[0] / INCHES
    with mpl.rc_context({**mpl.rcParamsDefault, **_STYLE}):
        figure = Figure(figsize=(INCHES, size[1] / dpi), dpi=dpi, layout=layout)
        FigureCanvasAgg(figure)
        if layout == "constrained":
            figure.get_layout_engine().set(w_pad=0.12, h_pad=0.12)
            _shrink(figure.suptitle(title, fontsize=HEADLINE, fontweight="bold"), size[0])
        else:
            middle = 1 - TITLE / 2 * size[0] / size[1]
            look = {"fontsize": HEADLINE, "fontweight": "bold", "ha": "center", "va": "center"}
            _shrink(figure.text(0.5, middle, title, **look), size[0])
        yield figure
        content = BytesIO()
        figure.savefig(content, dpi=dpi, format="png")
    if path is not None:
        write_file(path, content.getvalue())
    elif not isinstance(paper, str | Path):
        paper.write(content.getvalue())


def _shrink(text: Any, width: int) -> None:
    """Make a title smaller where it is wider than the sheet."""
    wide = float(text.get_window_extent().width)
    if wide > WIDEST * width:
        text.set_fontsize(text.get_fontsize() * WIDEST * width / wide)


def place_image(figure: Any, image: np.ndarray, left: int, top: int, title: str = "") -> Any:
    """Put an image onto the sheet, pixel on pixel, its title above it; return axes that count its pixels.

    Args:
        figure: The sheet.
        image: The image.
        left: Pixels from the sheet's left edge.
        top: Pixels from the sheet's upper edge.
        title: Words above the image.
    """
    height, width = image.shape[:2]
    figure.figimage(image, left, round(float(figure.bbox.height)) - top - height, origin="upper", zorder=-1)
    axes = figure.add_axes(_box(figure, left, top, width, height), xlim=(0, width), ylim=(height, 0))
    axes.set_axis_off()
    axes.set_title(title)
    return axes


def _box(figure: Any, left: int, top: int, width: int, height: int) -> tuple[float, float, float, float]:
    """Turn pixels from the upper left corner into matplotlib's fractions from the lower left one."""
    wide, high = (round(float(size)) for size in figure.bbox.size)
    return left / wide, 1 - (top + height) / high, width / wide, height / high


def scale_bar(axes: Any, image: np.ndarray, width: float, unit: str) -> None:
    """Draw a bar of round length into the lower left corner of an image shown in axes.

    Args:
        axes: Axes that show the image.
        image: The image.
        width: Width of what the image shows, [length].
        unit: Unit of length.
    """
    length = nice_number(width / 3)
    pixels = length / width * image.shape[1]
    left, bottom = 0.05 * image.shape[1], 0.94 * image.shape[0]
    axes.plot([left, left + pixels], [bottom, bottom], color=INK, linewidth=4, solid_capstyle="butt")
    box = {"facecolor": "white", "edgecolor": "none", "alpha": 0.75, "pad": 2}
    place = (left + pixels / 2, bottom - 0.02 * image.shape[0])
    axes.text(*place, f"{written(length, 1)} {unit}", ha="center", va="bottom", bbox=box)


def place_colour_bar(
    figure: Any,
    box: tuple[int, int, int],
    key: Any,
    label: str,
    **options: Any,
) -> None:
    """Put an upright colour bar onto the sheet.

    Args:
        figure: The sheet.
        box: Left, top and height in pixels.
        key: matplotlib's ScalarMappable: colour map and norm.
        label: What is shown, with its unit.
        **options: Keywords of matplotlib's ``colorbar``.
    """
    left, top, height = box
    axes = figure.add_axes(_box(figure, left, top, max(2, round(0.3 * figure.dpi)), height))
    figure.colorbar(key, cax=axes, label=label, **options)
