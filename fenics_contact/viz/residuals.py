"""Diagram of a solve: residuals and contact statuses against products with F."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path
from typing import TYPE_CHECKING, BinaryIO

import numpy as np
from matplotlib.axes import Axes
from matplotlib.ticker import MaxNLocator

from fenics_contact.display import counted
from fenics_contact.errors import InvalidInputError
from fenics_contact.qp import SolverStep
from fenics_contact.viz.colours import BLUE, GREEN, GREY, INK, ORANGE, PALE
from fenics_contact.viz.picture import Picture, draw_picture, png_path
from fenics_contact.viz.sheet import sheet
from fenics_contact.viz.words import headline, written

if TYPE_CHECKING:
    from mpi4py import MPI

#: More outer steps than this are marked by stripes only, without numbers.
MOST_NUMBERS = 16
#: Residuals this far below the others are rounding.
FLOOR = 1e-2
_RESIDUALS = {
    "natural": ("natural (contact)", BLUE, "o"),
    "gluing": ("gluing", ORANGE, "^"),
    "coarse": ("coarse (equilibrium)", GREEN, "s"),
}
_COUNTS = {"closed": (GREY, "closed", "-"), "stick": (BLUE, "stick", "--"), "slip": (ORANGE, "slip", ":")}


def plot_residuals(
    history: Sequence[SolverStep],
    path: str | Path | None = None,
    *,
    tolerance: float | None = None,
    title: str = "",
    width: int = 1200,
    comm: MPI.Comm | None = None,
) -> Picture:
    """Draw the residuals of a solve against products with F, and below the numbers of closed points.

    Stripes separate outer steps: Tresca problems of the Coulomb fixed point or rounds with a smaller
    tolerance. A change of method is marked by a line and its name.

    Args:
        history: ``state.solution.history``, or ``error.history`` of a `ConvergenceError`.
        path: PNG file to write, None to write none.
        tolerance: The required tolerance, drawn as a line.
        title: Text before the facts in the title.
        width: Width of the picture in pixels.
        comm: If given, only rank 0 draws, and an error is raised on all ranks.

    Returns:
        The picture, which can be used like a path to its file.

    Raises:
        InvalidInputError: If there is no step to draw, or the history is not that of a dual solver.

    Note:
        Collective on ``comm`` if given.

    Example:
        >>> try:  # doctest: +SKIP
        ...     state = solve_scene(scene, comm)
        ... except ConvergenceError as error:
        ...     plot_residuals(error.history, "residuals.png", comm=comm)
    """
    target = png_path(path)
    if not history:
        raise InvalidInputError(
            "a diagram of residuals needs a solver's steps, got none: states found without multipliers and "
            "states from a checkpoint have no history; pass state.solution.history of a state just solved"
        )
    strange = {type(step).__name__ for step in history if not isinstance(step, SolverStep)}
    if strange:
        raise InvalidInputError(
            f"a diagram of residuals needs steps of a dual solver, got {', '.join(sorted(strange))}: pass "
            "state.solution.history, or the history of the ConvergenceError of a solve"
        )
    if tolerance is not None and not tolerance > 0:
        raise InvalidInputError(f"tolerance must be positive, got {tolerance}: leave it out to draw no line")
    steps = tuple(history)
    return draw_picture(comm, target, lambda paper: _draw(steps, paper, tolerance, title, width))


def _draw(
    steps: tuple[SolverStep, ...], paper: BinaryIO, tolerance: float | None, title: str, width: int
) -> None:
    products = np.array([step.products for step in steps])
    methods = {step.method for step in steps}
    count = counted(len(steps), "step")
    count += f" of {methods.pop()}" if len(methods) == 1 else ""
    facts = f"natural residual {written(steps[-1].residuals.natural, 2)} after {written(int(products[-1]))} "
    facts += f"products with F in {count}"
    contacts = any(step.closed for step in steps)
    size = (width, round((0.66 if contacts else 0.5) * width))
    with sheet(paper, size, headline(title, facts)) as figure:
        ratios = {"height_ratios": [3, 1]} if contacts else {}
        panels = figure.subplots(2 if contacts else 1, 1, sharex=True, squeeze=False, gridspec_kw=ratios)[
            :, 0
        ]
        _draw_residuals(panels[0], steps, products, tolerance)
        if contacts:
            _draw_counts(panels[1], steps, products)
        for axes in panels:
            _stripes(axes, steps, products)
            axes.grid(axis="y", color=GREY, alpha=0.3)
            axes.set_xlim(0, 1.02 * float(products[-1]))
        _name_stripes(panels[0], steps, products)
        panels[-1].set_xlabel("products with F")
        panels[-1].xaxis.set_major_locator(MaxNLocator(integer=True))


def _draw_residuals(
    axes: Axes, steps: tuple[SolverStep, ...], products: np.ndarray, tolerance: float | None
) -> None:
    values = {
        name: np.array([getattr(step.residuals, name) for step in steps], dtype=float) for name in _RESIDUALS
    }
    steering = np.concatenate([values["natural"], values["gluing"], [tolerance or np.nan]])
    known = steering[np.isfinite(steering) & (steering > 0)]
    floor = FLOOR * float(known.min(initial=1.0))
    few = len(steps) <= 60
    for name, (words, colour, symbol) in _RESIDUALS.items():
        shown = np.where(values[name] > floor, values[name], np.nan)
        if np.any(np.isfinite(shown)):
            look = {"marker": symbol, "ms": 6} if few else {}
            axes.plot(products, shown, color=colour, lw=1.8, label=words, zorder=3, **look)
    if tolerance is not None:
        axes.axhline(tolerance, color=INK, lw=1.2, ls="--", label="tolerance")
    axes.set_yscale("log")
    axes.set_ylabel("relative residual")
    axes.legend(loc="upper right", ncols=4, frameon=True, framealpha=0.85, edgecolor="none")
    low, high = axes.get_ylim()
    axes.set_ylim(low, high * (high / low) ** 0.16)  # room for the legend


def _draw_counts(axes: Axes, steps: tuple[SolverStep, ...], products: np.ndarray) -> None:
    for name, (colour, words, line) in _COUNTS.items():
        counts = [getattr(step, name) for step in steps]
        axes.plot(products, counts, color=colour, lw=1.8, ls=line, label=words, zorder=3)
    axes.set_ylabel("contact points")
    axes.yaxis.set_major_locator(MaxNLocator(4, integer=True))
    axes.legend(loc="center left", bbox_to_anchor=(1.0, 0.5))


def _borders(labels: Sequence[object], products: np.ndarray) -> list[tuple[object, float, float]]:
    """Return the runs of equal labels: label, products before the run, products at its end."""
    ends = [k for k in range(len(labels)) if k + 1 == len(labels) or labels[k + 1] != labels[k]]
    starts = [0.0, *(float(products[k]) for k in ends[:-1])]
    return [(labels[k], start, float(products[k])) for k, start in zip(ends, starts, strict=True)]


def _stripes(axes: Axes, steps: tuple[SolverStep, ...], products: np.ndarray) -> None:
    for number, (_, start, end) in enumerate(_borders([step.outer for step in steps], products)):
        if number % 2:
            axes.axvspan(start, end, color=PALE, alpha=0.6, lw=0, zorder=0)
    for _, start, _ in _borders([step.method for step in steps], products)[1:]:
        axes.axvline(start, color=INK, lw=1.0)


def _name_stripes(axes: Axes, steps: tuple[SolverStep, ...], products: np.ndarray) -> None:
    """Number the outer steps above the axes and name the methods where they begin, if there are several."""
    places = axes.get_xaxis_transform()
    outer = _borders([step.outer for step in steps], products)
    if 1 < len(outer) <= MOST_NUMBERS:
        for label, start, end in outer:
            middle = (start + end) / 2
            axes.text(middle, 1.005, f"{label}", transform=places, ha="center", va="bottom")
        axes.text(0.0, 1.06, "outer steps", transform=axes.transAxes, ha="left", va="bottom")
    methods = _borders([step.method for step in steps], products)
    for method, start, _ in methods if len(methods) > 1 else []:
        look = {"rotation": 90, "ha": "left", "va": "bottom"}
        axes.text(start, 0.03, f" {method}", transform=places, **look)
