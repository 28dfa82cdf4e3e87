"""Diagram of an optimisation: objective against evaluations."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path
from typing import TYPE_CHECKING, BinaryIO

import numpy as np
from matplotlib.ticker import MaxNLocator

from fenics_contact.errors import InvalidInputError
from fenics_contact.viz.colours import BLUE, GREY, ORANGE
from fenics_contact.viz.picture import Picture, draw_picture, png_path
from fenics_contact.viz.sheet import sheet
from fenics_contact.viz.words import change, headline

if TYPE_CHECKING:
    from mpi4py import MPI

KINDS = ("start", "serious", "null", "rejected", "refined")


def plot_convergence(
    values: Sequence[float] | np.ndarray,
    kinds: Sequence[str] | None = None,
    path: str | Path | None = None,
    *,
    label: str = "objective",
    title: str = "",
    logarithmic: bool = False,
    width: int = 1200,
    comm: MPI.Comm | None = None,
) -> Picture:
    """Draw the objective of every evaluation: the start and serious steps connected, null steps as points.

    Args:
        values: Objective of each trial point in the order of evaluation, (n,); NaN where it was rejected.
        kinds: Outcome of each: "start", "serious", "null", "rejected" or "refined"; needed.
        path: PNG file to write, None to write none.
        label: Name of the objective, with its unit.
        title: Text before the facts in the title.
        logarithmic: Draw a positive objective logarithmically, so that a trial far off does not dominate.
        width: Width of the picture in pixels.
        comm: If given, only rank 0 draws, and an error is raised on all ranks.

    Returns:
        The picture, which can be used like a path to its file.

    Raises:
        InvalidInputError: If the arrays are inconsistent or hold no start.

    Note:
        Collective on ``comm`` if given.
    """
    target = png_path(path)
    objective, kind = _checked(values, kinds)
    if logarithmic and np.nanmin(objective) <= 0.0:
        raise InvalidInputError(
            f"a logarithmic diagram needs a positive objective, got {np.nanmin(objective):g}: leave "
            "logarithmic=False"
        )
    number, centre = np.arange(len(objective)), np.isin(kind, ("start", "serious", "refined"))
    first, last = objective[centre][0], objective[centre][-1]
    words = headline(title, f"{label} {change(first, last)}")

    def draw(paper: BinaryIO) -> None:
        with sheet(paper, (width, round(0.6 * width)), words) as figure:
            axes = figure.subplots()
            axes.set(xlabel="evaluation", ylabel=label, yscale="log" if logarithmic else "linear")
            main = {"color": BLUE, "lw": 2, "ms": 8, "label": "start and serious steps"}
            axes.plot(number[centre], objective[centre], "-o", **main)
            null, rejected = kind == "null", number[kind == "rejected"]
            if np.any(null):
                white = {"mfc": "white", "mec": ORANGE, "mew": 1.8, "ms": 8, "label": "null steps"}
                axes.plot(number[null], objective[null], "o", **white)
            if len(rejected):  # on the lower edge, as such a point has no value
                look = {"color": GREY, "ms": 8, "transform": axes.get_xaxis_transform()}
                axes.plot(rejected, np.full(len(rejected), 0.03), "x", label="rejected points", **look)
            axes.xaxis.set_major_locator(MaxNLocator(integer=True))
            axes.grid(axis="y", color=GREY, alpha=0.3)
            axes.legend(loc="best")

    return draw_picture(comm, target, draw)


def _checked(
    values: Sequence[float] | np.ndarray, kinds: Sequence[str] | None
) -> tuple[np.ndarray, np.ndarray]:
    try:
        if kinds is None:
            raise TypeError("no kinds")
        objective, kind = np.asarray(values, dtype=float), np.asarray(kinds, dtype=str)
    except (TypeError, ValueError) as error:
        raise InvalidInputError(
            "values must be numbers and kinds words, one for each evaluation, got "
            f"{type(values).__name__} and {type(kinds).__name__}: of the result of an "
            "optimisation give [each.value for each in result.history] and the same of each.kind"
        ) from error
    if objective.ndim != 1 or objective.shape != kind.shape:
        raise InvalidInputError(
            f"values and kinds must have one entry for each evaluation, got {objective.shape} and "
            f"{kind.shape}: pass both from the same history"
        )
    unknown = sorted(set(kind.tolist()) - set(KINDS))
    if unknown:
        raise InvalidInputError(f"kinds must be among {KINDS}, got {unknown}: translate them first")
    if not np.any(kind == "start"):
        raise InvalidInputError(
            'a history begins with its "start", got none: pass it from the first evaluation'
        )
    if not np.all(np.isfinite(objective[kind != "rejected"])):
        raise InvalidInputError(
            "the objective must be finite wherever it was not rejected: mark rejected points"
        )
    return objective, kind
