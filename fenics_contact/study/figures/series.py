"""Runs that belong together, with their style in every figure."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any, BinaryIO

from matplotlib.ticker import FuncFormatter, LogLocator, NullFormatter

from fenics_contact.mesh import CELL_TYPES
from fenics_contact.study.errors import Errors
from fenics_contact.study.parameters import BALANCED
from fenics_contact.study.results import Run
from fenics_contact.viz import BLUE, GREEN, GREY, ORANGE, Picture, draw_picture, png_path

WIDTH = 1600
#: Colours and symbols, by cell type and by contact discretisation other than the base's.
LOOKS = {
    "cell": ((GREEN, "s"), ("#882255", "X"), ("#332288", "p")),
    "discretisation": (("#cc79a7", "D"),),
}


@dataclass(frozen=True)
class Series:
    """Some runs of a study.

    Attributes:
        name: Its label.
        runs: The runs, coarse ones first.
        colour: Its colour.
        symbol: Its symbol, so that colours are not needed.
        connected: Whether the runs form a sequence.
    """

    name: str
    runs: tuple[Run, ...]
    colour: str
    symbol: str
    connected: bool = True

    def draw(self, axes: Any, x: list[float], y: list[float], label: str | None = None) -> None:
        """Draw the series into axes with logarithmic scales or not."""
        axes.plot(
            x, y, linestyle="-" if self.connected else "none", marker=self.symbol, color=self.colour,
            lw=2.0, ms=8, markeredgecolor="white", markeredgewidth=0.6, zorder=3,
            label=self.name if label is None else label,
        )  # fmt: skip


def picture(errors: Errors, path: Path | None, draw: Callable[[Errors, BinaryIO], None]) -> Picture:
    """Return a function's picture of a study, and write it to a PNG file if there is a path."""
    return draw_picture(None, png_path(path), lambda paper: draw(errors, paper))


def series_of(errors: Errors) -> list[Series]:
    """Return the runs of a study grouped by what they vary; every run is in at most one series."""
    base, results = errors.results.base, errors.results
    strict = errors.strictest(base)
    name = "" if strict.balanced else f"tolerance {strict.tolerance_words}"
    grouped = [
        Series("balanced", errors.sequence(replace(base, tolerance=BALANCED)), BLUE, "o"),
        Series(name, () if strict.balanced else errors.sequence(strict), ORANGE, "^"),
        *(series for setting in LOOKS for series in _others(errors, setting)),
        Series("fixed point", _varied(errors, "solver"), "#56b4e9", "v", False),
        Series("other subdomains", _varied(errors, "subdomains"), "#e69f00", "P", False),
    ]
    known = [run for series in grouped for run in series.runs]
    rest = tuple(run for run in results.good if run not in known)
    grouped.append(Series("other tolerances", rest, GREY, ".", False))
    return [series for series in grouped if series.runs]


def _others(errors: Errors, setting: str) -> list[Series]:
    """Return the series of every value of a setting other than the base's."""
    base, others = errors.results.base, []
    values = dict.fromkeys(getattr(run.parameters, setting) for run in _varied(errors, setting))
    for number, value in enumerate(values):
        name = CELL_TYPES[value].plural if value in CELL_TYPES else f"contact by {value}"
        runs = errors.sequence(replace(base, **{setting: value}))
        others.append(Series(name, runs, *LOOKS[setting][number % len(LOOKS[setting])]))
    return others


def _varied(errors: Errors, setting: str) -> tuple[Run, ...]:
    base = errors.results.base
    return tuple(run for run in errors.results.good if setting in run.parameters.differences(base))


def by_mesh_and_tolerance(errors: Errors) -> tuple[Sequence[Run], Sequence[Run]]:
    """Return the runs on all meshes, balanced, and those with all tolerances on the base's mesh."""
    base = errors.results.base
    varied = [run for run in errors.results.good if replace(run.parameters, tolerance=base.tolerance) == base]
    return errors.sequence(replace(base, tolerance=BALANCED)), varied


def panels(figure: Any, count: int) -> list[Any]:
    """Return axes for a number of panels, two or three side by side."""
    columns = count if count < 4 else (2 if count == 4 else 3)
    axes = figure.subplots(-(-count // columns), columns, squeeze=False).ravel()
    for spare in axes[count:]:
        spare.set_axis_off()
    return list(axes[:count])


def height(count: int) -> int:
    """Return the height in pixels of a sheet with a number of panels."""
    return 160 + 560 * (1 if count < 4 else 2)


def style(axes: Any) -> None:
    """Put a grid behind the data."""
    axes.grid(color=GREY, alpha=0.3, which="major")
    axes.set_axisbelow(True)


def scaled(axes: Any) -> None:
    """Make both axes logarithmic, the vertical one in percent, with numbers in full and a grid."""
    axes.set_xscale("log")
    axes.set_yscale("log")
    for axis, scale, unit in ((axes.xaxis, 1.0, ""), (axes.yaxis, 100.0, " %")):
        low, high = axis.get_view_interval()
        subs = (1.0, 2.0, 5.0) if high < 50.0 * low else (1.0,)  # 2 and 5 where the range is small
        axis.set_major_locator(LogLocator(subs=subs, numticks=12))
        written = lambda value, _, scale=scale, unit=unit: f"{scale * value:g}{unit}"  # noqa: E731
        axis.set_major_formatter(FuncFormatter(written))
        axis.set_minor_formatter(NullFormatter())
    style(axes)


def against(errors: Errors, quantity: str) -> str:
    """Return what a quantity's errors are relative to, in words."""
    kind = errors.references[quantity].kind
    words = {"extrapolated": "the limit of the meshes", "finest mesh": "the finest mesh"}
    return f"(against {words.get(kind, kind)})"
