"""Time by phase, stacked."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any, BinaryIO

from fenics_contact.display import counted
from fenics_contact.study.errors import Errors
from fenics_contact.study.figures.series import WIDTH, by_mesh_and_tolerance, picture, style
from fenics_contact.study.results import Run
from fenics_contact.viz import FAMILIES, SPARE, Picture, sheet

#: Phases from the bottom of a bar to its top.
ORDER = (
    "mesh", "decompose", "assemble", "factor", "preconditioner", "coarse space", "solve", "errors", "state"
)  # fmt: skip
COLOURS = dict(zip(ORDER, (SPARE, *FAMILIES[0], *FAMILIES[1]), strict=True))
#: Colours of phases that are not in the list, in their order.
MORE = ("#aaaa00", "#666666", "#000000")


def plot_phases(errors: Errors, path: Path | None = None) -> Picture:
    """Draw the seconds by phase: by mesh at the balanced tolerance, by tolerance on the base's mesh.

    Args:
        errors: Errors of a study's runs.
        path: PNG file to write, None to write none.

    Returns:
        The picture, which can be used like a path to its file.
    """
    return picture(errors, path, _draw_all)


def _draw_all(errors: Errors, paper: BinaryIO) -> None:
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
    """Draw stacked bars of phases, with the sum above them.

    Args:
        axes: Matplotlib axes.
        bars: Time of every phase, by bar.
        names: Labels below the bars.
        unit: Unit after the sums.
    """
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
