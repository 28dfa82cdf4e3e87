"""The figures of a study, of `Errors`, for files and notebooks.

Each takes the path of a PNG file, or none, and returns a picture that notebooks show. They need matplotlib,
an extra; only the report imports them.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, replace
from functools import partial, wraps
from pathlib import Path
from typing import Any, BinaryIO

from matplotlib.ticker import FuncFormatter, LogLocator, NullFormatter

from fenics_contact._base.display import counted
from fenics_contact.mesh.cell_types import CELL_TYPES
from fenics_contact.pictures.canvas import (
    BLUE,
    FAMILIES,
    GREEN,
    GREY,
    INK,
    ORANGE,
    SPARE,
    Picture,
    draw_picture,
    png_path,
    sheet,
)
from fenics_contact.study.results import Errors, Run, measured_rate
from fenics_contact.study.study import BALANCED, QuantityFacts

#: Width of a figure in pixels.
WIDTH = 1600
#: Colours and symbols, by cell type and by contact discretisation other than the base's.
LOOKS = {
    "cell": ((GREEN, "s"), ("#882255", "X"), ("#332288", "p")),
    "discretisation": (("#cc79a7", "D"),),
}


@dataclass(frozen=True)
class Series:
    """Some runs of a study, with a symbol so that colours are not needed."""

    name: str
    runs: tuple[Run, ...]
    colour: str
    symbol: str
    connected: bool = True

    def draw(self, axes: Any, x: list[float], y: list[float], label: str) -> None:
        """Draw the series into axes with logarithmic scales or not."""
        axes.plot(
            x, y, linestyle="-" if self.connected else "none", marker=self.symbol, color=self.colour,
            lw=2.0, ms=8, markeredgecolor="white", markeredgewidth=0.6, zorder=3,
            label=label,
        )  # fmt: skip


def drawn(draw: Callable[[Errors, BinaryIO], None]) -> Callable[..., Picture]:
    """Let a function return its picture, and write it to a PNG file if it is given a path."""

    @wraps(draw)
    def plot(errors: Errors, path: Path | None = None) -> Picture:
        return draw_picture(None, png_path(path), lambda paper: draw(errors, paper))

    return plot


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


def pareto_front(costs: Sequence[float], errors: Sequence[float]) -> list[int]:
    """Return the indices of the Pareto-optimal points, by rising cost."""
    front: list[int] = []
    for number in sorted(range(len(costs)), key=lambda k: (costs[k], errors[k])):
        if not front or errors[number] < errors[front[-1]]:
            front.append(number)
    return front


@drawn
def plot_accuracy(errors: Errors, paper: BinaryIO) -> None:
    """Draw the error of every run in every quantity over its time, and the Pareto front."""
    scene, ranks, runs = errors.results.scene, errors.results.ranks, errors.results.good
    quantities = [each for each in scene.quantities if any(errors.of(run, each.name) for run in runs)]
    title = f"{scene.title}: error against time on {counted(ranks, 'rank')}"
    with sheet(paper, (WIDTH, height(len(quantities))), title) as figure:
        handles: dict[str, Any] = {}
        for axes, quantity in zip(panels(figure, len(quantities)), quantities, strict=True):
            _draw_accuracy(axes, errors, quantity)
            handles |= dict(zip(*axes.get_legend_handles_labels()[::-1], strict=True))
        columns = len(handles) if len(handles) < 7 else -(-len(handles) // 2)
        figure.legend(handles.values(), handles.keys(), loc="outside lower center", ncols=columns)


def _draw_accuracy(axes: Any, errors: Errors, quantity: QuantityFacts) -> None:
    x: list[float] = []
    y: list[float] = []
    for series in series_of(errors):
        known = [(run.seconds_of(quantity), e) for run in series.runs if (e := errors.of(run, quantity.name))]
        if known:
            series.draw(axes, [seconds for seconds, _ in known], [error for _, error in known], series.name)
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


#: Height of the legends under a row of panels in pixels.
LEGENDS = 120


@drawn
def plot_convergence(errors: Errors, paper: BinaryIO) -> None:
    """Draw the error of every quantity, and the estimate of the mesh's error, over the mesh size."""
    ways = [series for series in series_of(errors) if series.connected and len(series.runs) > 1]
    ways = [series for series in ways if series.name != "balanced"] if len(ways) > 1 else ways
    runs, scene = [run for series in ways for run in series.runs], errors.results.scene
    quantities = [each for each in scene.quantities if any(errors.of(run, each.name) for run in runs)]
    count = len(quantities) + 1
    size = (WIDTH, height(count) + LEGENDS * (1 + (count > 3)))
    with sheet(paper, size, f"{scene.title}: convergence") as figure:
        drawn = panels(figure, count)
        for axes, quantity in zip(drawn, quantities, strict=False):
            _draw_convergence(axes, errors, ways, partial(errors.of, quantity=quantity.name), quantity.rate)
            axes.set_ylabel("relative error")
            axes.set_title(f"{quantity.name}\n{against(errors, quantity.name)}", fontsize="medium")
        _draw_convergence(
            drawn[-1], errors, ways, lambda run: (run.parts or {}).get("discretisation"), scene.energy_rate
        )
        drawn[-1].set_ylabel("error over energy norm")
        drawn[-1].set_title("estimated error of the displacement")


def _draw_convergence(
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


#: Part -> words, colour, symbol.
PARTS = {
    "discretisation": ("mesh (estimate)", BLUE, "o"),
    "algebraic": ("solver (certificate)", ORANGE, "^"),
    "friction": ("law of friction (estimate)", GREEN, "s"),
}


@drawn
def plot_parts(errors: Errors, paper: BinaryIO) -> None:
    """Draw the parts and their shares: by mesh if balanced, by tolerance on the base's mesh."""
    scene, base = errors.results.scene, errors.results.base
    meshes, varied = ([run for run in runs if run.parts] for runs in by_mesh_and_tolerance(errors))
    with sheet(paper, (WIDTH, 1000), f"{scene.title}: parts of the error") as figure:
        axes = figure.subplots(2, 2, sharey="row")
        _draw_parts(axes[:, 0], meshes, [str(run.parameters.size) for run in meshes])
        _draw_parts(axes[:, 1], varied, [run.parameters.tolerance_words for run in varied])
        axes[0, 0].set_title("balanced tolerance")
        axes[0, 1].set_title(f"{base.size} {scene.size_name}")
        axes[1, 0].set_xlabel(scene.size_name)
        axes[1, 1].set_xlabel("tolerance")
        axes[0, 0].set_ylabel("error over energy norm")
        axes[1, 0].set_ylabel("share of the sum")
        handles, labels = axes[0, 1].get_legend_handles_labels()
        figure.legend(handles, labels, loc="outside lower center", ncols=5)


def _draw_parts(column: Any, runs: Sequence[Run], names: Sequence[str]) -> None:
    """Draw the parts into the upper axes and their shares into the lower ones."""
    (sizes, shares), places, below = column, list(range(len(runs))), [0.0] * len(runs)
    values = {part: [float((run.parts or {}).get(part) or 0.0) for run in runs] for part in PARTS}
    totals = [sum(each) or 1.0 for each in zip(*values.values(), strict=True)]
    for part, (words, colour, symbol) in PARTS.items():
        if any(values[part]):  # logarithmic axes have no zero
            known = [value or float("nan") for value in values[part]]
            sizes.plot(
                places, known, marker=symbol, color=colour, lw=2, ms=9, markeredgecolor="white", label=words
            )
        heights = [100 * value / total for value, total in zip(values[part], totals, strict=True)]
        shares.bar(places, heights, 0.6, bottom=below, color=colour, edgecolor="white")
        below = [low + height for low, height in zip(below, heights, strict=True)]
    true = [float((run.true_errors or {}).get("total") or "nan") for run in runs]
    sizes.plot(places, true, ls="none", marker="x", ms=9, mew=2, color=INK, label="solver and friction, true")
    sizes.set_yscale("log")
    style(sizes)
    shares.set_ylim(0, 100)
    shares.yaxis.set_major_formatter(lambda value, _: f"{value:g} %")
    for axes in column:
        axes.set_xticks(places, names)
        axes.set_xlim(-0.5, len(runs) - 0.5)


#: Phases from the bottom of a bar to its top.
ORDER = (
    "mesh", "decompose", "assemble", "factor", "preconditioner", "coarse space", "solve", "errors", "state"
)  # fmt: skip
COLOURS = dict(zip(ORDER, (SPARE, *FAMILIES[0], *FAMILIES[1]), strict=True))
#: Colours of phases that are not in the list, in their order.
MORE = ("#aaaa00", "#666666", "#000000")


@drawn
def plot_phases(errors: Errors, paper: BinaryIO) -> None:
    """Draw the seconds by phase: by mesh at the balanced tolerance, by tolerance on the base's mesh."""
    results = errors.results
    meshes, varied = by_mesh_and_tolerance(errors)
    title = f"{results.scene.title}: time by phase on {counted(results.ranks, 'rank')}"
    with sheet(paper, (WIDTH, 760), title) as figure:
        left, right = figure.subplots(1, 2)
        tolerances = [run.parameters.tolerance_words for run in varied]
        draw_stacked(left, [run.phases for run in meshes], [_mesh(run) for run in meshes])
        draw_stacked(right, [run.phases for run in varied], tolerances)
        left.set_xlabel(f"{results.scene.size_name}, torn unknowns below; balanced tolerance")
        right.set_xlabel(f"tolerance, with {results.base.size} {results.scene.size_name}")
        left.set_ylabel("wall time (s)")
        known: dict[str, Any] = {}
        for axes in (left, right):
            known |= dict(zip(*axes.get_legend_handles_labels()[::-1], strict=True))
            style(axes)
            axes.grid(visible=False, axis="x")
        figure.legend(known.values(), known.keys(), loc="outside lower center", ncols=5)


def _mesh(run: Run) -> str:
    return f"{run.parameters.size}\n{(run.counts or {}).get('torn_unknowns', 0) / 1e3:.1f} k"


def draw_stacked(
    axes: Any, bars: Sequence[Mapping[str, float]], names: Sequence[str], unit: str = ""
) -> None:
    """Draw stacked bars of phases, with the sum above them."""
    phases = dict.fromkeys(phase for bar in bars for phase in bar)
    others = [phase for phase in phases if phase not in ORDER]
    colours, below = COLOURS | dict(zip(others, MORE, strict=False)), [0.0] * len(bars)
    for phase in [*(phase for phase in ORDER if phase in phases), *others]:
        heights = [bar.get(phase, 0.0) for bar in bars]
        axes.bar(
            range(len(bars)), heights, 0.65, bottom=below, color=colours.get(phase), edgecolor="white",
            lw=0.6, label=phase,
        )  # fmt: skip
        below = [low + height for low, height in zip(below, heights, strict=True)]
    for place, top in enumerate(below):
        words = (f"{top:.0f}" if top >= 10.0 else f"{top:.2g}") + unit
        axes.annotate(words, (place, top), (0, 4), textcoords="offset points", ha="center")
    axes.set_xticks(range(len(bars)), names)
    axes.set_xlim(-0.6, len(bars) - 0.4)
    axes.set_ylim(0, 1.12 * max(below, default=1.0))
