"""Time by phase, stacked."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from pathlib import Path
from typing import Any, BinaryIO

from fenics_contact.study.errors import Errors
from fenics_contact.study.figures.parts import tolerance_words
from fenics_contact.study.figures.series import WIDTH, style
from fenics_contact.study.parameters import BALANCED
from fenics_contact.study.results import Run
from fenics_contact.viz import FAMILIES, SPARE, Picture, draw_picture, png_path, sheet

#: Phases from the bottom of a bar to its top.
ORDER = (
    "mesh",
    "decompose",
    "assemble",
    "factor",
    "preconditioner",
    "coarse space",
    "solve",
    "errors",
    "state",
)
COLOURS = dict(zip(ORDER, (SPARE, *FAMILIES[0], *FAMILIES[1]), strict=True))
#: Colours of phases that are not in the list, in their order.
MORE = ("#aaaa00", "#666666", "#000000")


def plot_phases(errors: Errors, path: Path | None = None) -> Picture:
    """Draw the seconds by phase: by mesh at the balanced tolerance, by tolerance on the base's mesh.

    Args:
        errors: Errors of a study's runs.
        path: PNG file to write, None to write none.

    Returns:
        The picture, which stands for its file where a path is needed.
    """
    return draw_picture(None, png_path(path), lambda paper: _draw_all(errors, paper))


def _draw_all(errors: Errors, paper: BinaryIO) -> None:
    results, base = errors.results, errors.results.base
    meshes = errors.sequence(replace(base, tolerance=BALANCED))
    varied = [run for run in results.good if replace(run.parameters, tolerance=base.tolerance) == base]
    ranks = results.ranks
    title = f"{results.scene.title}: time by phase on {ranks} rank{'s' if ranks > 1 else ''}"
    with sheet(paper, (WIDTH, 760), title) as figure:
        left, right = figure.subplots(1, 2)
        _draw(left, meshes, [f"{run.parameters.size}\n{_unknowns(run)}" for run in meshes])
        _draw(right, varied, [tolerance_words(run) for run in varied])
        left.set_xlabel(f"{results.scene.size_name}, torn unknowns below; balanced tolerance")
        right.set_xlabel(f"tolerance, with {base.size} {results.scene.size_name}")
        left.set_ylabel("wall time (s)")
        handles, labels = left.get_legend_handles_labels()
        more = dict(zip(*right.get_legend_handles_labels()[::-1], strict=True))
        known = dict(zip(labels, handles, strict=True)) | more
        figure.legend(known.values(), known.keys(), loc="outside lower center", ncols=10)


def _unknowns(run: Run) -> str:
    return f"{(run.counts or {}).get('torn_unknowns', 0) / 1e3:.1f} k"


def _draw(axes: Any, runs: Sequence[Run], names: Sequence[str]) -> None:
    found = {phase: None for run in runs for phase in run.phases}
    phases = [phase for phase in ORDER if phase in found]
    phases += [phase for phase in found if phase not in ORDER]
    colours = COLOURS | dict(zip([phase for phase in phases if phase not in ORDER], MORE, strict=False))
    below = [0.0] * len(runs)
    for phase in phases:
        heights = [run.phases.get(phase, 0.0) for run in runs]
        axes.bar(
            range(len(runs)), heights, 0.65, bottom=below, color=colours.get(phase), edgecolor="white",
            lw=0.6, label=phase,
        )  # fmt: skip
        below = [low + height for low, height in zip(below, heights, strict=True)]
    for place, top in enumerate(below):
        axes.annotate(f"{top:.2g}", (place, top), (0, 4), textcoords="offset points", ha="center")
    axes.set_xticks(range(len(runs)), names)
    axes.set_xlim(-0.6, len(runs) - 0.4)
    axes.set_ylim(0, 1.12 * max(below, default=1.0))
    style(axes)
    axes.grid(visible=False, axis="x")
