"""The three parts of the error: solver, law of friction, mesh."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path
from typing import Any, BinaryIO

from fenics_contact.study.errors import Errors
from fenics_contact.study.figures.series import WIDTH, by_mesh_and_tolerance, picture, style
from fenics_contact.study.results import Run
from fenics_contact.viz import BLUE, GREEN, INK, ORANGE, Picture, sheet

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
        The picture, which can be used like a path to its file.
    """
    return picture(errors, path, _draw_all)


def _draw_all(errors: Errors, paper: BinaryIO) -> None:
    scene, base = errors.results.scene, errors.results.base
    meshes, varied = ([run for run in runs if run.parts] for runs in by_mesh_and_tolerance(errors))
    with sheet(paper, (WIDTH, 1000), f"{scene.title}: parts of the error") as figure:
        axes = figure.subplots(2, 2, sharey="row")
        _draw(axes[:, 0], meshes, [str(run.parameters.size) for run in meshes])
        _draw(axes[:, 1], varied, [run.parameters.tolerance_words for run in varied])
        axes[0, 0].set_title("balanced tolerance")
        axes[0, 1].set_title(f"{base.size} {scene.size_name}")
        axes[1, 0].set_xlabel(scene.size_name)
        axes[1, 1].set_xlabel("tolerance")
        axes[0, 0].set_ylabel("error over energy norm")
        axes[1, 0].set_ylabel("share of the sum")
        handles, labels = axes[0, 1].get_legend_handles_labels()
        figure.legend(handles, labels, loc="outside lower center", ncols=5)


def _draw(column: Any, runs: Sequence[Run], names: Sequence[str]) -> None:
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
