"""Runs that belong together, with the look they have in every figure."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from typing import Any

from matplotlib.ticker import FuncFormatter, LogLocator, NullFormatter

from fenics_contact.study.errors import Errors
from fenics_contact.study.parameters import BALANCED
from fenics_contact.study.results import Run
from fenics_contact.study.words import plural
from fenics_contact.viz import BLUE, GREEN, GREY, ORANGE

WIDTH = 1600
#: Colours and symbols of cells and of discretisations of contact other than the base's, in turn.
CELL_LOOKS = ((GREEN, "s"), ("#882255", "X"), ("#332288", "p"))
CONTACT_LOOKS = (("#cc79a7", "D"),)


@dataclass(frozen=True)
class Series:
    """Some runs of a study.

    Attributes:
        name: In words.
        runs: The runs, coarse ones first.
        colour: Its colour.
        symbol: Its symbol, so that colours are not needed.
        connected: Whether the runs are one after the other on a way.
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


def series_of(errors: Errors) -> list[Series]:
    """Return the runs of a study sorted by what they vary; every run is in one series at most."""
    base, results = errors.results.base, errors.results
    strict = errors.strictest(base)
    name = "" if strict.balanced else f"tolerance {strict.tolerance:.0e}"
    found = [
        Series("balanced", errors.sequence(replace(base, tolerance=BALANCED)), BLUE, "o"),
        Series(name, () if strict.balanced else errors.sequence(strict), ORANGE, "^"),
        *_others(errors, "cell", lambda run: run.parameters.cell, CELL_LOOKS),
        *_others(errors, "discretisation", lambda run: run.parameters.discretisation, CONTACT_LOOKS),
        Series("fixed point", _varied(errors, "solver"), "#56b4e9", "v", False),
        Series("other subdomains", _varied(errors, "subdomains"), "#e69f00", "P", False),
    ]
    known = [run for series in found for run in series.runs]
    rest = tuple(run for run in results.good if run not in known)
    found.append(Series("other tolerances", rest, GREY, ".", False))
    return [series for series in found if series.runs]


def _others(
    errors: Errors, setting: str, of: Callable[[Run], str], looks: Sequence[tuple[str, str]]
) -> list[Series]:
    """Return the series of every value of a setting other than the base's."""
    base = errors.results.base
    values = dict.fromkeys(of(run) for run in errors.results.good if of(run) != getattr(base, setting))
    found = []
    for number, value in enumerate(values):
        runs = errors.sequence(replace(base, **{setting: value}))  # type: ignore[arg-type]
        found.append(Series(plural(value), runs, *looks[number % len(looks)]))
    return found


def _varied(errors: Errors, setting: str) -> tuple[Run, ...]:
    base = errors.results.base
    return tuple(run for run in errors.results.good if setting in run.parameters.differences(base))


def panels(figure: Any, count: int) -> list[Any]:
    """Return axes for so many panels, two or three beside each other."""
    columns = count if count < 4 else (2 if count == 4 else 3)
    rows = -(-count // columns)
    axes = figure.subplots(rows, columns, squeeze=False).ravel()
    for spare in axes[count:]:
        spare.set_axis_off()
    return list(axes[:count])


def height(count: int) -> int:
    """Return the height in pixels of a sheet with so many panels."""
    rows = 1 if count < 4 else 2
    return 160 + 560 * rows


def style(axes: Any) -> None:
    """Put a grid behind the data."""
    axes.grid(color=GREY, alpha=0.3, which="major")
    axes.set_axisbelow(True)


def logarithmic(axis: Any, scale: float = 1.0, unit: str = "") -> None:
    """Write the numbers of a logarithmic axis in full, and 2 and 5 between powers of ten if it spans few.

    Args:
        axis: Axis of axes whose data are drawn.
        scale: What numbers are multiplied by, 100 for percent.
        unit: What stands behind them.
    """
    low, high = axis.get_view_interval()
    axis.set_major_locator(LogLocator(subs=(1.0, 2.0, 5.0) if high < 50.0 * low else (1.0,), numticks=12))
    axis.set_major_formatter(FuncFormatter(lambda value, _: f"{scale * value:g}{unit}"))
    axis.set_minor_formatter(NullFormatter())


def against(kind: str) -> str:
    """Return what errors are measured against, in words."""
    return {"extrapolated": "the limit of the meshes", "finest mesh": "the finest mesh"}.get(kind, kind)
