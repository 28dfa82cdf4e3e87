"""Error against time."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path
from typing import Any, BinaryIO

from fenics_contact.display import counted
from fenics_contact.study.errors import Errors
from fenics_contact.study.figures.series import (
    WIDTH,
    against,
    height,
    panels,
    picture,
    scaled,
    series_of,
)
from fenics_contact.study.protocol import QuantityFacts
from fenics_contact.viz import INK, Picture, sheet


def plot_accuracy(errors: Errors, path: Path | None = None) -> Picture:
    """Draw the error of every run in every quantity over its time, and the Pareto front.

    Args:
        errors: Errors of a study's runs.
        path: PNG file to write, None to write none.

    Returns:
        The picture, which can be used like a path to its file.
    """
    return picture(errors, path, _draw_all)


def pareto_front(costs: Sequence[float], errors: Sequence[float]) -> list[int]:
    """Return the indices of the Pareto-optimal points, by rising cost.

    Args:
        costs: Cost of each point, (n,).
        errors: Error of each point, (n,).
    """
    front: list[int] = []
    for number in sorted(range(len(costs)), key=lambda k: (costs[k], errors[k])):
        if not front or errors[number] < errors[front[-1]]:
            front.append(number)
    return front


def _draw_all(errors: Errors, paper: BinaryIO) -> None:
    scene, ranks, runs = errors.results.scene, errors.results.ranks, errors.results.good
    quantities = [each for each in scene.quantities if any(errors.of(run, each.name) for run in runs)]
    title = f"{scene.title}: error against time on {counted(ranks, 'rank')}"
    with sheet(paper, (WIDTH, height(len(quantities))), title) as figure:
        handles: dict[str, Any] = {}
        for axes, quantity in zip(panels(figure, len(quantities)), quantities, strict=True):
            _draw(axes, errors, quantity)
            handles |= dict(zip(*axes.get_legend_handles_labels()[::-1], strict=True))
        columns = len(handles) if len(handles) < 7 else -(-len(handles) // 2)
        figure.legend(handles.values(), handles.keys(), loc="outside lower center", ncols=columns)


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
    scaled(axes)
    axes.set_xlabel("wall time (s)")
    axes.set_ylabel("relative error")
    axes.set_title(f"{quantity.name}\n{against(errors, quantity.name)}")
