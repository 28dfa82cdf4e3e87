"""Error against mesh size, with the theoretical and the measured rate."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from functools import partial
from pathlib import Path
from typing import Any, BinaryIO

from matplotlib.ticker import FuncFormatter

from fenics_contact.study.errors import Errors
from fenics_contact.study.figures.series import (
    WIDTH,
    Series,
    against,
    height,
    panels,
    picture,
    scaled,
    series_of,
)
from fenics_contact.study.results import Run
from fenics_contact.study.richardson import measured_rate
from fenics_contact.viz import INK, Picture, sheet

#: Height of the legends under a row of panels in pixels.
LEGENDS = 120


def plot_convergence(errors: Errors, path: Path | None = None) -> Picture:
    """Draw the error of every quantity, and the estimate of the mesh's error, over the mesh size.

    Args:
        errors: Errors of a study's runs.
        path: PNG file to write, None to write none.

    Returns:
        The picture, which can be used like a path to its file.
    """
    return picture(errors, path, _draw_all)


def _draw_all(errors: Errors, paper: BinaryIO) -> None:
    ways = [series for series in series_of(errors) if series.connected and len(series.runs) > 1]
    ways = [series for series in ways if series.name != "balanced"] if len(ways) > 1 else ways
    runs, scene = [run for series in ways for run in series.runs], errors.results.scene
    quantities = [each for each in scene.quantities if any(errors.of(run, each.name) for run in runs)]
    count = len(quantities) + 1
    size = (WIDTH, height(count) + LEGENDS * (1 + (count > 3)))
    with sheet(paper, size, f"{scene.title}: convergence") as figure:
        drawn = panels(figure, count)
        for axes, quantity in zip(drawn, quantities, strict=False):
            _draw(axes, errors, ways, partial(errors.of, quantity=quantity.name), quantity.rate)
            axes.set_ylabel("relative error")
            axes.set_title(f"{quantity.name}\n{against(errors, quantity.name)}", fontsize="medium")
        _draw(drawn[-1], errors, ways, _estimate, scene.energy_rate)
        drawn[-1].set_ylabel("error over energy norm")
        drawn[-1].set_title("estimated error of the displacement")


def _estimate(run: Run) -> float | None:
    return (run.parts or {}).get("discretisation")


def _draw(
    axes: Any,
    errors: Errors,
    ways: Sequence[Series],
    error: Callable[[Run], float | None],
    rate: float | None,
) -> None:
    """Draw the error on every mesh, and a line with the theoretical rate below the first series."""
    scene, through = errors.results.scene, None
    places = sorted({scene.spacing[run.parameters.size] for run in errors.results.good})
    for series in ways:
        known = [(scene.spacing[run.parameters.size], e) for run in series.runs if (e := error(run))]
        if known:
            h, wrong = [h for h, _ in known], [e for _, e in known]
            measured = measured_rate(h, wrong)
            series.draw(axes, h, wrong, series.name + ("" if measured is None else f": rate {measured:.2f}"))
            through = through or known[-1]
    if rate and through is not None:
        ends = [through[0], places[-1]]
        line = [0.7 * through[1] * (h / through[0]) ** rate for h in ends]
        axes.plot(ends, line, color=INK, ls="--", lw=1.6, label=f"theory: rate {rate:g}")
    scaled(axes)
    axes.set_xticks(places)
    axes.xaxis.set_major_formatter(FuncFormatter(lambda value, _: f"{value:.3g}"))
    axes.minorticks_off()
    axes.set_xlabel(f"mesh size h{f' ({scene.spacing_unit})' if scene.spacing_unit else ''}")
    axes.legend(loc="upper center", bbox_to_anchor=(0.5, -0.16), fontsize=11)
