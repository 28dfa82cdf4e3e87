"""Diagram of curves: computed results and reference solutions."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from itertools import cycle
from pathlib import Path
from typing import TYPE_CHECKING, BinaryIO, Literal, TypeAlias

import numpy as np

from fenics_contact.errors import InvalidInputError
from fenics_contact.viz.colours import BLUE, GREEN, GREY, INK, ORANGE
from fenics_contact.viz.picture import Picture, draw_picture, png_path
from fenics_contact.viz.sheet import sheet

if TYPE_CHECKING:
    from mpi4py import MPI

#: Abscissas and ordinates of one curve, (n,) each.
Curve: TypeAlias = tuple[Sequence[float] | np.ndarray, Sequence[float] | np.ndarray]

#: Colours and symbols of the series, distinguishable also without colours.
LOOKS = (
    (BLUE, "o"),
    (ORANGE, "^"),
    (GREEN, "s"),
    ("#cc79a7", "D"),
    ("#56b4e9", "v"),
    ("#e69f00", "P"),
)
#: With more points than this a series is drawn as a line.
MOST_SYMBOLS = 90


def plot_curves(
    series: Mapping[str, Curve],
    path: str | Path | None = None,
    *,
    xlabel: str,
    ylabel: str,
    reference: Mapping[str, Curve] | None = None,
    connected: bool = False,
    logarithmic: bool | Literal["y"] = False,
    title: str = "",
    width: int = 1200,
    comm: MPI.Comm | None = None,
) -> Picture:
    """Draw series of points, each in its colour and symbol, on top of dark reference curves.

    Args:
        series: Name -> abscissas and ordinates, computed or measured. NaN leaves a gap.
        path: PNG file to write, None to write none.
        xlabel: Label of the abscissas with unit.
        ylabel: Label of the ordinates with unit.
        reference: Name -> abscissas and ordinates of the reference curves.
        connected: Whether to connect the points of a series in their order.
        logarithmic: Whether both axes are logarithmic, for convergence; "y" for the ordinates alone.
        title: Title.
        width: Width of the picture in pixels.
        comm: If given, only rank 0 draws, and an error is raised on all ranks.

    Returns:
        The picture, which can be used like a path to its file.

    Raises:
        InvalidInputError: If there is nothing to draw, or a curve has different numbers of abscissas and
            ordinates.

    Note:
        Collective on ``comm`` if given.

    Example:
        >>> shear = {"computed": ([0.0, 1.0], [0.0, 2.0])}
        >>> plot_curves(shear, "shear.png", xlabel="x (mm)", ylabel="q (MPa)")  # doctest: +SKIP
    """
    target = png_path(path)
    shown = {name: _checked(name, curve) for name, curve in series.items()}
    behind = {name: _checked(name, curve) for name, curve in (reference or {}).items()}
    if not shown and not behind:
        raise InvalidInputError("a diagram needs at least one curve, got none: pass series={'name': (x, y)}")

    def draw(paper: BinaryIO) -> None:
        with sheet(paper, (width, round(0.6 * width)), title) as figure:
            axes = figure.subplots()
            for (name, (x, y)), style in zip(behind.items(), cycle(("-", "--", ":", "-."))):
                axes.plot(x, y, style, color=INK, lw=1.6, label=name, zorder=2)
            for (name, (x, y)), (colour, symbol) in zip(shown.items(), cycle(LOOKS)):
                few = len(x) <= MOST_SYMBOLS
                line, marker = "-" if connected or not few else "none", symbol if few else "none"
                edge = {"ms": 7, "markeredgecolor": "white", "markeredgewidth": 0.6}
                look = {"linestyle": line, "marker": marker, "color": colour, "lw": 2.2, **edge}
                axes.plot(x, y, label=name, zorder=3, **look)
            axes.set(xlabel=xlabel, ylabel=ylabel)
            if logarithmic:
                axes.set_yscale("log")
                axes.set_xscale("linear" if logarithmic == "y" else "log")
            axes.grid(color=GREY, alpha=0.3)
            axes.set_axisbelow(True)
            longest = max(map(len, (*shown, *behind)))
            columns = min(len(shown) + len(behind), max(1, 110 // (longest + 8)))
            figure.legend(loc="outside lower center", ncols=columns)

    return draw_picture(comm, target, draw)


def _checked(name: str, curve: Curve) -> tuple[np.ndarray, np.ndarray]:
    x, y = (np.asarray(values, dtype=np.float64) for values in curve)
    if x.ndim != 1 or x.shape != y.shape or not len(x):
        raise InvalidInputError(
            f"curve {name!r} must have one value for each place, got {y.shape} for {x.shape}: pass two "
            "arrays of the same length"
        )
    return x, y
