"""The sheet of paper: a matplotlib figure with the house's fonts, and its atomic way into a file."""

from __future__ import annotations

import os
import secrets
from collections.abc import Callable, Iterator
from contextlib import contextmanager, nullcontext
from pathlib import Path
from typing import TYPE_CHECKING, Any

import matplotlib as mpl
import numpy as np
from matplotlib.backends.backend_agg import FigureCanvasAgg
from matplotlib.cm import ScalarMappable
from matplotlib.colors import Normalize
from matplotlib.figure import Figure

from fenics_contact.errors import InvalidInputError, together
from fenics_contact.viz.colours import INK

if TYPE_CHECKING:
    from mpi4py import MPI

DPI = 100

_STYLE = {
    "font.family": "sans-serif",
    "font.sans-serif": ["DejaVu Sans"],
    "font.size": 13,
    "axes.titlesize": 14,
    "axes.labelsize": 13,
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
def sheet(path: str | Path, size: tuple[int, int], title: str) -> Iterator[Any]:
    """Open an empty figure and save it at the end, whole or not at all.

    Args:
        path: PNG file; its folder is created. A file of that name is replaced when the new one is complete.
        size: Width and height in pixels.
        title: Title above everything.

    Yields:
        A matplotlib Figure.

    Raises:
        InvalidInputError: If the name does not end in ".png" or the size is not positive.
    """
    target = png_path(path)
    with mpl.rc_context({**mpl.rcParamsDefault, **_STYLE}):
        figure = Figure(figsize=(size[0] / DPI, size[1] / DPI), dpi=DPI, layout="constrained")
        FigureCanvasAgg(figure)
        figure.get_layout_engine().set(w_pad=0.12, h_pad=0.12)
        figure.suptitle(title, fontsize=16, fontweight="bold")
        yield figure
        target.parent.mkdir(parents=True, exist_ok=True)
        temporary = target.with_name(f".{target.stem}.{secrets.token_hex(4)}.png")
        try:
            figure.savefig(temporary, dpi=DPI, format="png")
            os.replace(temporary, target)
        finally:
            temporary.unlink(missing_ok=True)


def png_path(path: str | Path) -> Path:
    """Return the path, refuse one that names no PNG file."""
    target = Path(path)
    if target.suffix != ".png":
        raise InvalidInputError(f"pictures are PNG files, got the name {target.name!r}: let it end in '.png'")
    return target


def draw_on_one_rank(comm: MPI.Comm | None, draw: Callable[[], None]) -> None:
    """Let rank 0 draw; if it fails, all ranks raise. Collective on ``comm`` if given."""
    with nullcontext() if comm is None else together(comm):
        if comm is None or comm.rank == 0:
            draw()


def show_image(axes: Any, image: np.ndarray, title: str = "") -> None:
    """Put a rendered image into axes without scales."""
    axes.imshow(image, interpolation="antialiased")
    axes.set_axis_off()
    if title:
        axes.set_title(title)


def scale_bar(axes: Any, image: np.ndarray, width: float, unit: str) -> None:
    """Draw a bar of round length into the lower left corner of an image shown in axes.

    Args:
        axes: Axes that show the image.
        image: The image.
        width: Width of what the image shows, [length].
        unit: Unit of length.
    """
    length = nice_number(width / 5)
    pixels = length / width * image.shape[1]
    left, bottom = 0.04 * image.shape[1], 0.94 * image.shape[0]
    axes.plot([left, left + pixels], [bottom, bottom], color=INK, linewidth=4, solid_capstyle="butt")
    box = {"facecolor": "white", "edgecolor": "none", "alpha": 0.75, "pad": 2}
    place = (left + pixels / 2, bottom - 0.02 * image.shape[0])
    axes.text(*place, f"{written(length, 1)} {unit}", ha="center", va="bottom", bbox=box)


def colour_bar(
    figure: Any, axes: Any, colours: Any, clim: tuple[float, float], label: str, **options: Any
) -> None:
    """Add the colour bar of a colour map over a range beside axes."""
    figure.colorbar(ScalarMappable(Normalize(*clim), colours), ax=axes, label=label, **options)


def checked_range(clim: tuple[float, float]) -> tuple[float, float]:
    """Return a colour range, refuse one that is empty or not finite."""
    low, high = (float(value) for value in clim)
    if not (np.isfinite(low) and np.isfinite(high) and low < high):
        raise InvalidInputError(f"clim must be a finite range (low, high) with low < high, got {clim}: widen it")
    return low, high


def written(value: float, digits: int = 4) -> str:
    """Write a number for readers: 79 713, −0.138, 1.2e−05; thousands apart, a true minus.

    Args:
        value: The number.
        digits: Significant digits of what is not an integer.
    """
    size = abs(value)
    if isinstance(value, int | np.integer):
        text = f"{value:,}"
    elif size == 0 or 1e-3 <= size < 1e7:
        decimals = digits - 1 - int(np.floor(np.log10(size))) if size else 0
        text = f"{round(value, decimals):,.{max(0, decimals)}f}"
    else:
        text = f"{value:.{digits - 1}e}"
    return text.replace(",", "\u202f").replace("-", "\u2212")


def nice_number(value: float) -> float:
    """Round down to 1, 2 or 5 times a power of ten; 1 for what is not positive."""
    if not value > 0:
        return 1.0
    power = 10.0 ** np.floor(np.log10(value))
    return float(power * max(step for step in (1.0, 2.0, 5.0) if step * power <= value * (1 + 1e-9)))
