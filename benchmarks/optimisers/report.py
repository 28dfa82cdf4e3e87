"""The study: its jobs, the tables of its page and its picture."""

from __future__ import annotations

import json
from dataclasses import asdict
from pathlib import Path
from typing import Any

import matplotlib
import numpy as np

matplotlib.use("Agg")
from matplotlib import pyplot as plt

from benchmarks.cases.roller_design import PEAK
from benchmarks.optimisers.measuring import ALLOWED, FULL, METHODS, QUICK, budget_of
from benchmarks.study import ROOT, Records, Study, filled, found, unfilled
from fenics_contact.output import versions, write_json, write_text
from fenics_contact.study.report import table
from fenics_contact.study.runner import Job

LOOKS = {
    "bundle": ("#0072b2", "o", "-"),
    "bundle, adaptive states": ("#56b4e9", "v", "-"),
    "SLSQP": ("#d55e00", "s", "--"),
    "trust-constr": ("#cc79a7", "^", "--"),
    "COBYLA": ("#009e73", "D", ":"),
    "Rosenbrock": ("#e69f00", "P", ":"),
}
#: What products and times are compared with.
USUAL = "bundle"
#: Smallest distance to the best value that the picture tells apart from none.
LEAST = 1e-6
#: Distances to the best largest pressure of the roller, relative to it, for which states are counted.
NEAR = (0.1, 0.01, 0.001)


def tables(study: dict[str, Any]) -> dict[str, str]:
    """Return the tables of the page by their names: all problems in one, and states of the roller."""
    parts = []
    for case in dict.fromkeys(run["case"] for run in study["runs"]):
        runs = [run for run in study["runs"] if run["case"] == case]
        first = runs[0]
        parts.append(f"## {case[0].upper()}{case[1:]}\n")
        parts.append(f"{first['unknowns']} unknowns; J before: {first['history'][0][0]:.1f} {_unit(first)}\n")
        parts.append(_table(runs))
    rollers = [run for run in study["runs"] if "roller" in run["case"]]
    return {"problems": "\n".join(parts)} | ({"roller": _even(rollers)} if rollers else {})


def states_to(run: dict[str, Any], pressure: float) -> int | None:
    """Return after how many states a method met a design with less pressure, None where it met none."""
    below = (
        number
        for number, (value, violation, *_) in enumerate(run["history"], 1)
        if value is not None and violation <= ALLOWED and value <= pressure
    )
    return next(below, None)


def _even(runs: list[dict[str, Any]]) -> str:
    best = {run["case"]: min(each["value"] for each in runs if each["case"] == run["case"]) for run in runs}
    rows = [
        (run["case"].rpartition(", ")[2], run["method"],
         *(str(states_to(run, (1.0 + near) * best[run["case"]]) or "–") for near in NEAR),
         f"{run['value'] / PEAK:.4f}", str(run["evaluations"]))
        for run in runs
    ]  # fmt: skip
    return table(
        ("start", "method", *(f"to {100 * near:g} %" for near in NEAR), "best over p0", "states"), rows
    )


def above_best(run: dict[str, Any], runs: list[dict[str, Any]]) -> float:
    """Return by how much a method's value lies above the best on this problem, relative to it."""
    best = min(other["value"] for other in runs if other["case"] == run["case"])
    return float((run["value"] - best) / abs(best))


def _unit(run: dict[str, Any]) -> str:
    return {"total potential": "N mm", "largest pressure": "N/mm²"}.get(run["objective"], "N")


def _table(runs: list[dict[str, Any]]) -> str:
    usual = next(run for run in runs if run["method"] == USUAL)
    rows = [
        (run["method"], f"{run['value']:.2f}", f"{100 * above_best(run, runs):.3f} %",
         f"{max(run['violation'], 0.0):.0e}" if run["violation"] > 1e-12 else "none",
         f"{run['evaluations']} ({run['best_evaluation']})", str(run["invalid"] or "none"),
         str(run["products"]), f"{run['products'] / usual['products']:.2f}",
         f"{run['seconds'] / usual['seconds']:.1f}", run["stop"])
        for run in runs
    ]  # fmt: skip
    head = (
        "method", f"J [{_unit(runs[0])}]", "above the best", "violation", "evaluations (best)", "not there",
        "products", "products, ratio", "time, ratio", "stop",
    )  # fmt: skip
    return table(head, rows) + "\n"


def plot(path: Path, runs: list[dict[str, Any]]) -> None:
    """Draw how close to the best value every method came, by evaluations and by products, a row a problem."""
    cases = list(dict.fromkeys(run["case"] for run in runs))
    figure, grid = plt.subplots(
        len(cases), 2, figsize=(11, 3.1 * len(cases) + 0.6), layout="constrained", squeeze=False
    )
    for case, axes in zip(cases, grid, strict=True):
        mine = [run for run in runs if run["case"] == case]
        for run in mine:
            _curve(axes, run, mine)
        axes[0].set_title(case, fontsize="medium", loc="left")
        axes[0].set_ylabel("above the best")
    for axis, label in zip(grid[-1], ("evaluations", "products with the dual operator"), strict=True):
        axis.set_xlabel(label)
    shown: dict[str, Any] = {}
    for row in grid:
        shown |= dict(zip(*row[0].get_legend_handles_labels()[::-1], strict=True))
    figure.legend(shown.values(), shown, loc="outside lower center", ncols=len(shown), frameon=False)
    figure.savefig(path, dpi=130)
    plt.close(figure)


def _curve(axes: Any, run: dict[str, Any], runs: list[dict[str, Any]]) -> None:
    best = min(other["value"] for other in runs)
    colour, marker, line = LOOKS[run["method"]]
    rows = [
        (np.inf if row[0] is None or row[1] > ALLOWED else row[0], number, row[2])
        for number, row in enumerate(run["history"], 1)
    ]
    values, numbers, products = np.array(rows).T
    # What was claimed on the way may lie a little below what is true: by the tolerance of the state.
    reached = np.maximum((np.minimum.accumulate(values) - best) / abs(best), LEAST)
    end = max(above_best(run, runs), LEAST)
    for axis, place in zip(axes, (numbers, products), strict=True):
        axis.semilogy(place, reached, color=colour, linestyle=line, linewidth=1.4)
        axis.semilogy(place[-1], end, marker=marker, color=colour, linestyle="none", label=run["method"])
        axis.set_xscale("log")
        axis.grid(True, alpha=0.3)
        axis.spines[["top", "right"]].set_visible(False)


HOME = ROOT / "docs" / "studies" / "optimisers"


def jobs(quick: bool) -> list[Job]:
    """Return a job for every problem and method."""
    return [
        Job(
            f"{case.name}, {method}", "benchmarks.optimisers.measuring:run",
            {"case": asdict(case), "method": method, "budget": budget}, limit=4 * 3600.0,
        )
        for case in (QUICK if quick else FULL)
        for method in METHODS
        if (budget := budget_of(case, method, quick))
    ]  # fmt: skip


def write(folder: Path, records: Records, quick: bool) -> None:
    """Write numbers, page and picture; problems of which a method was not measured keep their numbers."""
    study = {"runs": []} if quick else json.loads((HOME / "results.json").read_text())
    measured = [found(each[0]) for each in records.values()]
    runs: list[dict[str, Any]] = []
    for case in QUICK if quick else FULL:
        mine = [run for run in measured if run["case"] == case.name]
        whole = len(mine) == sum(budget_of(case, method, quick) > 0 for method in METHODS)
        runs += mine if whole else [run for run in study["runs"] if run["case"] == case.name]
    if records:
        study = {"runs": runs, "quick": quick, "versions": versions()}
        write_json(folder / "results.json", study)
    texts = tables(study)
    page = unfilled(texts) if quick else filled((HOME / "README.md").read_text(encoding="utf-8"), texts)
    write_text(folder / "README.md", page)
    plot(folder / "optimisers.png", study["runs"])


CODE = (ROOT / "benchmarks" / "cases", Path(__file__).parent)
study = Study(jobs, write, HOME, CODE)
