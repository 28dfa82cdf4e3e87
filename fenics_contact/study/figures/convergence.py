"""Error against mesh size, with the rate that theory states beside the measured one."""

from __future__ import annotations

from pathlib import Path
from typing import Any, BinaryIO

from matplotlib.ticker import FuncFormatter, NullFormatter

from fenics_contact.study.errors import Errors
from fenics_contact.study.figures.series import (
    WIDTH,
    Series,
    against,
    height,
    logarithmic,
    panels,
    series_of,
    style,
)
from fenics_contact.study.protocol import QuantityFacts
from fenics_contact.study.richardson import measured_rate
from fenics_contact.viz import INK, Picture, draw_picture, png_path, sheet

#: Height of the legends under a row of panels in pixels.
LEGENDS = 120


def plot_convergence(errors: Errors, path: Path | None = None) -> Picture:
    """Draw the error of every quantity, and the estimate of the mesh's error, over the mesh size.

    Args:
        errors: Errors of a study's runs.
        path: PNG file to write, None to write none.

    Returns:
        The picture, which stands for its file where a path is needed.
    """
    return draw_picture(None, png_path(path), lambda paper: _draw_all(errors, paper))


def _draw_all(errors: Errors, paper: BinaryIO) -> None:
    ways = [series for series in series_of(errors) if series.connected and len(series.runs) > 1]
    ways = [series for series in ways if series.name != "balanced"] if len(ways) > 1 else ways
    quantities = [
        quantity
        for quantity in errors.results.scene.quantities
        if any(errors.of(run, quantity.name) for series in ways for run in series.runs)
    ]
    count = len(quantities) + 1
    title = f"{errors.results.scene.title}: convergence"
    with sheet(paper, (WIDTH, height(count) + LEGENDS * (1 + (count > 3))), title) as figure:
        drawn = panels(figure, count)
        for axes, quantity in zip(drawn, quantities, strict=False):
            _draw(axes, errors, quantity, ways)
        _draw_estimate(drawn[-1], errors, ways)
        for axes in drawn:
            _scales(axes, errors)


def _draw(axes: Any, errors: Errors, quantity: QuantityFacts, ways: list[Series]) -> None:
    spacing, first = errors.results.scene.spacing, None
    for series in ways:
        known = [
            (spacing[run.parameters.size], e) for run in series.runs if (e := errors.of(run, quantity.name))
        ]
        if known:
            h, error = [h for h, _ in known], [e for _, e in known]
            series.draw(axes, h, error, _with_rate(series.name, measured_rate(h, error)))
            first = first or known[-1]
    if quantity.rate and first is not None:
        _slope(axes, errors, first, quantity.rate)
    axes.set_ylabel("relative error")
    axes.set_title(
        f"{quantity.name}\n(against {against(errors.references[quantity.name].kind)})", fontsize="medium"
    )


def _draw_estimate(axes: Any, errors: Errors, ways: list[Series]) -> None:
    spacing, last = errors.results.scene.spacing, None
    for series in ways:
        runs = [run for run in series.runs if run.parts and run.parts["discretisation"]]
        if runs:
            h = [spacing[run.parameters.size] for run in runs]
            value = [float((run.parts or {})["discretisation"] or "nan") for run in runs]
            last = last or (h[-1], value[-1])
            series.draw(axes, h, value, _with_rate(series.name, measured_rate(h, value)))
    if last is not None:
        _slope(axes, errors, last, errors.results.scene.energy_rate)
    axes.set_ylabel("error over energy norm")
    axes.set_title("estimated error of the displacement")


def _with_rate(name: str, rate: float | None) -> str:
    return name if rate is None else f"{name}: rate {rate:.2f}"


def _slope(axes: Any, errors: Errors, through: tuple[float, float], rate: float) -> None:
    """Draw the line of theory's rate, a little below the point it belongs to."""
    h = sorted(errors.results.scene.spacing[run.parameters.size] for run in errors.results.good)
    ends = [max(h[0], through[0]), h[-1]]
    axes.plot(
        ends, [0.7 * through[1] * (x / through[0]) ** rate for x in ends], color=INK, ls="--", lw=1.6,
        label=f"theory: rate {rate:g}",
    )  # fmt: skip


def _scales(axes: Any, errors: Errors) -> None:
    results = errors.results
    sizes = sorted({run.parameters.size for run in results.good})
    unit = results.scene.spacing_unit
    axes.set_xscale("log")
    axes.set_yscale("log")
    logarithmic(axes.yaxis, 100.0, " %")
    places = [results.scene.spacing[size] for size in sizes]
    axes.set_xticks(places)
    axes.xaxis.set_major_formatter(FuncFormatter(lambda value, _: f"{value:.3g}"))
    axes.xaxis.set_minor_formatter(NullFormatter())
    axes.minorticks_off()
    axes.set_xlabel(f"mesh size h{f' ({unit})' if unit else ''}")
    axes.legend(loc="upper center", bbox_to_anchor=(0.5, -0.16), fontsize=11)
    style(axes)
