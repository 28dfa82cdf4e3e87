"""The picture of the results: the chain by phase, and the block beside other solvers."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import matplotlib

matplotlib.use("Agg")
from matplotlib import pyplot as plt

from benchmarks.plan import BLOCKS
from benchmarks.report import chain_sizes
from benchmarks.targets import Summaries, newton_names, unknowns
from fenics_contact.study.figures import draw_stacked

#: Where seconds stand beside a marker, so that those of lines close to each other do not meet.
ABOVE = {"xytext": (0, 8), "ha": "center"}
BESIDE = {"xytext": (-9, 3), "ha": "right"}
BELOW = {"xytext": (0, -8), "ha": "center", "va": "top"}


def plot_results(path: Path, summaries: Summaries) -> None:
    """Write the picture as PNG."""
    figure, (left, right) = plt.subplots(1, 2, figsize=(11, 4.6), layout="constrained")
    _plot_phases(left, summaries)
    _plot_blocks(right, summaries)
    figure.savefig(path, dpi=130)
    plt.close(figure)


def _plot_phases(axes: Any, summaries: Summaries) -> None:
    runs = chain_sizes(summaries)
    labels = [f"{unknowns(run) / 1e3:,.0f} k".replace(",", " ") for run in runs.values()]
    bars = [{p: 1e6 * s / unknowns(run) for p, s in run["phases"].items()} for run in runs.values()]
    draw_stacked(axes, bars, labels, " µs")
    axes.set_xlim(-0.6, len(runs) + 0.5)
    axes.set_xlabel("torn unknowns of the chain")
    axes.set_ylabel("wall time per unknown [µs]")
    axes.set_title("Chain with friction, gmsh to state, 2 ranks")
    handles, names = axes.get_legend_handles_labels()
    axes.legend(handles[::-1], names[::-1], frameon=False, loc="center right", fontsize="small")
    axes.spines[["top", "right"]].set_visible(False)


def _plot_blocks(axes: Any, summaries: Summaries) -> None:
    series = {
        "GetFEM, its contact brick": (["getfem-{}"], "s", "#b279a2", ABOVE),
        "monolithic Newton + MUMPS": (newton_names("{}"), "^", "#4c78a8", ABOVE),
        "one linear solve by CG + GAMG": (["gamg-{}"], "v", "#54a24b", BESIDE),
        "one linear solve by MUMPS's Cholesky": (["cholesky-{}"], "D", "#bab0ac", ABOVE),
        "fenics_contact": (["block-{}"], "o", "#f58518", BELOW),
    }
    for label, (names, marker, colour, place) in series.items():
        points = []
        for size in BLOCKS:
            runs = [summaries.get(name.format(size), {}) for name in names]
            seconds = [(run["seconds"], unknowns(run)) for run in runs if "seconds" in run]
            points += [min(seconds)] if seconds else []
        if points:
            x, y = [n for _, n in points], [s for s, _ in points]
            axes.loglog(x, y, marker=marker, color=colour, label=label, linewidth=2, markersize=7)
            for n, s in zip(x, y, strict=True):
                text = f"{s:.1f} s" if s < 10 else f"{s:.0f} s"
                axes.annotate(text, (n, s), textcoords="offset points", fontsize="small", **place)
    sizes = [unknowns(summaries[f"block-{s}"]) for s in BLOCKS if f"block-{s}" in summaries]
    axes.set_xticks(sizes, [f"{size / 1e3:.0f} k" for size in sizes])
    axes.minorticks_off()
    axes.margins(0.12, 0.15)
    axes.set_xlabel("unknowns of the block")
    axes.set_ylabel("wall time, mesh to state [s]")
    axes.set_title("Block sliding on a plane, two cores each")
    axes.grid(True, which="major", alpha=0.3)
    axes.spines[["top", "right"]].set_visible(False)
    if axes.get_legend_handles_labels()[0]:
        axes.legend(frameon=False, loc="upper left", fontsize="small")
