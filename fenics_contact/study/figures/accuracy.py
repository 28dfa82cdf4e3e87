"""Error against time: what every second buys."""

from __future__ import annotations

from pathlib import Path
from typing import Any, BinaryIO

from fenics_contact.study.errors import Errors
from fenics_contact.study.figures.series import WIDTH, against, height, logarithmic, panels, series_of, style
from fenics_contact.study.pareto import pareto_front
from fenics_contact.study.protocol import QuantityFacts
from fenics_contact.viz import INK, Picture, draw_picture, png_path, sheet


def plot_accuracy(errors: Errors, path: Path | None = None) -> Picture:
    """Draw the error of every run in every quantity over its time, and the Pareto front.

    Args:
        errors: Errors of a study's runs.
        path: PNG file to write, None to write none.

    Returns:
        The picture, which stands for its file where a path is needed.
    """
    return draw_picture(None, png_path(path), lambda paper: _draw_all(errors, paper))


def _draw_all(errors: Errors, paper: BinaryIO) -> None:
    quantities = _known(errors)
    scene, ranks = errors.results.scene, errors.results.ranks
    title = f"{scene.title}: error against time on {ranks} rank{'s' if ranks > 1 else ''}"
    with sheet(paper, (WIDTH, height(len(quantities))), title) as figure:
        for axes, quantity in zip(panels(figure, len(quantities)), quantities, strict=True):
            _draw(axes, errors, quantity)
        handles = {
            label: handle
            for axes in figure.axes
            for handle, label in zip(*axes.get_legend_handles_labels(), strict=True)
        }
        columns = len(handles) if len(handles) < 7 else -(-len(handles) // 2)
        figure.legend(handles.values(), handles.keys(), loc="outside lower center", ncols=columns)


def _known(errors: Errors) -> list[QuantityFacts]:
    """Return the quantities of which some error is known."""
    runs, quantities = errors.results.good, errors.results.scene.quantities
    return [quantity for quantity in quantities if any(errors.of(run, quantity.name) for run in runs)]


def _draw(axes: Any, errors: Errors, quantity: QuantityFacts) -> None:
    x: list[float] = []
    y: list[float] = []
    for series in series_of(errors):
        known = [(run.seconds_of(quantity), e) for run in series.runs if (e := errors.of(run, quantity.name))]
        if known:
            series.draw(axes, [seconds for seconds, _ in known], [error for _, error in known])
            x += [seconds for seconds, _ in known]
            y += [error for _, error in known]
    front = pareto_front(x, y)
    axes.plot(
        [x[k] for k in front], [y[k] for k in front], color=INK, lw=1.4, ls="--", drawstyle="steps-post",
        marker="o", ms=15, markerfacecolor="none", markeredgewidth=1.3, zorder=2, label="Pareto front",
    )  # fmt: skip
    axes.set_xscale("log")
    axes.set_yscale("log")
    logarithmic(axes.yaxis, 100.0, " %")
    logarithmic(axes.xaxis)
    axes.set_xlabel("wall time (s)")
    axes.set_ylabel("relative error")
    axes.set_title(f"{quantity.name} (against {against(errors.references[quantity.name].kind)})")
    style(axes)
