"""The three parts of the error: solver, law of friction, mesh."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from pathlib import Path
from typing import Any, BinaryIO

from fenics_contact.study.errors import Errors
from fenics_contact.study.figures.series import WIDTH, style
from fenics_contact.study.parameters import BALANCED
from fenics_contact.study.results import Run
from fenics_contact.viz import BLUE, GREEN, INK, ORANGE, Picture, draw_picture, png_path, sheet

#: Part -> words, colour, symbol.
PARTS = {
    "discretisation": ("mesh (estimate)", BLUE, "o"),
    "algebraic": ("solver (certificate)", ORANGE, "^"),
    "friction": ("law of friction (estimate)", GREEN, "s"),
}


def plot_parts(errors: Errors, path: Path | None = None) -> Picture:
    """Draw the parts and their shares: by mesh if balanced, by tolerance on the base's mesh.

    Args:
        errors: Errors of a study's runs.
        path: PNG file to write, None to write none.

    Returns:
        The picture, which stands for its file where a path is needed.
    """
    return draw_picture(None, png_path(path), lambda paper: _draw_all(errors, paper))


def _draw_all(errors: Errors, paper: BinaryIO) -> None:
    results, base = errors.results, errors.results.base
    meshes = [run for run in errors.sequence(replace(base, tolerance=BALANCED)) if run.parts]
    varied = [
        run for run in results.good if run.parts and replace(run.parameters, tolerance=base.tolerance) == base
    ]
    sizes, names = [str(run.parameters.size) for run in meshes], [tolerance_words(run) for run in varied]
    title = f"{results.scene.title}: parts of the error"
    with sheet(paper, (WIDTH, 1000), title) as figure:
        axes = figure.subplots(2, 2, sharey="row")
        _draw_sizes(axes[0, 0], meshes, sizes)
        _draw_sizes(axes[0, 1], varied, names)
        _draw_shares(axes[1, 0], meshes, sizes)
        _draw_shares(axes[1, 1], varied, names)
        axes[0, 0].set_title("balanced tolerance")
        axes[0, 1].set_title(f"{base.size} {results.scene.size_name}")
        axes[1, 0].set_xlabel(results.scene.size_name)
        axes[1, 1].set_xlabel("tolerance")
        axes[0, 0].set_ylabel("error over energy norm")
        axes[1, 0].set_ylabel("share of the sum")
        handles, labels = axes[0, 1].get_legend_handles_labels()
        figure.legend(handles, labels, loc="outside lower center", ncols=5)


def tolerance_words(run: Run) -> str:
    """Return the tolerance of a run as it stands on an axis."""
    return "balanced" if run.parameters.balanced else f"{run.parameters.tolerance:.0e}"


def _parts(runs: Sequence[Run], part: str) -> list[float]:
    return [float((run.parts or {}).get(part) or 0.0) for run in runs]


def _draw_sizes(axes: Any, runs: Sequence[Run], names: Sequence[str]) -> None:
    places = list(range(len(runs)))
    for part, (words, colour, symbol) in PARTS.items():
        if not any(_parts(runs, part)):
            continue  # a logarithm does not know nothing
        values = [value or float("nan") for value in _parts(runs, part)]
        axes.plot(
            places, values, marker=symbol, color=colour, lw=2, ms=9, markeredgecolor="white", label=words
        )
    true = [float((run.true_errors or {}).get("total") or "nan") for run in runs]
    axes.plot(places, true, ls="none", marker="x", ms=9, mew=2, color=INK, label="solver and friction, true")
    axes.set_yscale("log")
    axes.set_xlim(-0.5, len(runs) - 0.5)
    axes.set_xticks(places, names)
    style(axes)


def _draw_shares(axes: Any, runs: Sequence[Run], names: Sequence[str]) -> None:
    totals = [sum(_parts(runs, part)[k] for part in PARTS) or 1.0 for k in range(len(runs))]
    below = [0.0] * len(runs)
    for part, (_, colour, _) in PARTS.items():
        heights = [100 * value / total for value, total in zip(_parts(runs, part), totals, strict=True)]
        axes.bar(range(len(runs)), heights, 0.6, bottom=below, color=colour, edgecolor="white")
        below = [low + height for low, height in zip(below, heights, strict=True)]
    axes.set_xticks(range(len(runs)), names)
    axes.set_xlim(-0.5, len(runs) - 0.5)
    axes.set_ylim(0, 100)
    axes.yaxis.set_major_formatter(lambda value, _: f"{value:g} %")
