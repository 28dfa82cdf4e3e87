"""The study: its jobs, its page and its picture."""

from __future__ import annotations

import json
from dataclasses import asdict
from pathlib import Path
from typing import Any

import matplotlib
import numpy as np

matplotlib.use("Agg")
from matplotlib import pyplot as plt

from benchmarks.optimisers.measuring import ALLOWED, FULL, METHODS, QUICK, budget_of
from benchmarks.study import ROOT, Records, Study, found
from fenics_contact.io import versions, write_json, write_text
from fenics_contact.study.runner import Job
from fenics_contact.study.tables import table

LOOKS = {
    "bundle": ("#0072b2", "o", "-"),
    "bundle, adaptive states": ("#56b4e9", "v", "-"),
    "SLSQP": ("#d55e00", "s", "--"),
    "trust-constr": ("#cc79a7", "^", "--"),
    "COBYLA": ("#009e73", "D", ":"),
}
#: What products and times are compared with.
USUAL = "bundle"
#: Smallest distance to the best value that the picture tells apart from none.
LEAST = 1e-6

INTRODUCTION = """\
# SciPy's optimisers beside the bundle method

The shape of a chain link's crown: 28 control points, the volume may not fall, friction between the links.
All methods get the same function, the same start, the same box and the same row for the volume; SciPy's get
them from `fenics_contact.optimize.ForScipy`, which scales variables and values. Written by
`python -m benchmarks optimisers`.

![How close to the best, by evaluations and by products](optimisers.png)

- *total potential*: the objective of the demo, within ±0.25 mm. It is almost linear in the design, and its
  minimum lies in a corner of the box.
- *largest force*: the largest nodal contact force, within ±1 mm: a maximum over the contact points, of forces
  that have kinks themselves where points open, close, stick or slide. Its minimum has kinks through it.
- *above the best*: J of the best design of the method, moved onto the constraints and evaluated again, over
  the best of all methods on this problem; in the picture 1e-6 stands for the best itself.
- *evaluations*: states that were solved, and after how many of them the best design was met; *products*: with
  the dual operator, states and adjoints together, the measure of work that does not depend on the machine.
- *time*: over that of the bundle method, measured one after the other on a machine with other work: a rough
  figure.

The bundle method ("adaptive states": with `AdaptiveTolerance`) and SLSQP and trust-constr take a subgradient
with every value, COBYLA takes values alone, without adjoints. States are solved to 1e-8.
"""


def page(study: dict[str, Any]) -> str:
    """Return the page of Markdown."""
    graded = all("grading" in run for run in study["runs"])
    parts = [INTRODUCTION] if graded else [INTRODUCTION, EQUAL_CELLS]
    parts.append(FEW if study["quick"] else CONCLUSIONS)
    for case in dict.fromkeys(run["case"] for run in study["runs"]):
        runs = [run for run in study["runs"] if run["case"] == case]
        first = runs[0]
        parts.append(f"## {case[0].upper()}{case[1:]}\n")
        parts.append(f"{first['unknowns']} unknowns; J before: {first['history'][0][0]:.1f} {_unit(first)}\n")
        parts.append(_table(runs))
    parts.append(SETTINGS)
    return "\n".join(parts)


#: Of records that do not tell how far cells are graded.
EQUAL_CELLS = "Measured on links of equal cells and flat facets; those of the demo are graded since.\n"
FEW = "A quick run: the budget is a dozen evaluations, and nothing follows from it.\n"

CONCLUSIONS = """\
## What follows

- Where the objective is smooth, SciPy's SLSQP does as well: on the total potential it stops at the same value
  as the bundle method, after 11 evaluations instead of 4, which are few in either case. COBYLA comes lower
  still, by 3e-5, less than the tolerance of the others, for twenty times the products.
- Where it has kinks, the bundle method goes on where the others stand still: on the coarse chain it ends
  within 0.02 % of the best after 43 to 59 evaluations. SLSQP may be *faster to a rough answer* (5 % above
  the best after two evaluations from the link as it is), but then it stops between 0.06 % and 2.5 % above the
  best and says that it converged. trust-constr ends 0.2 % to 0.5 % above, not done after 150 evaluations.
- COBYLA, without any derivative, beats SLSQP and trust-constr in one of three searches (0.07 %) and is the
  worst in the others (0.5 %, 3 %). For 28 variables it is no bad choice where there is no adjoint.
- On the finer chain the difference grows: with more contact points the maximum has more kinks, and after 80
  evaluations SLSQP and trust-constr are a third above the bundle method, which has not converged either.
- Adaptive states save the bundle method between 23 % and 48 % of the products on all problems; with the
  budget spent, on the finer chain, it was 0.7 % behind.
- SLSQP asked for designs with inverted cells in three searches; `ForScipy` turned it back each time.

So: SLSQP by way of `ForScipy` for a smooth objective, or for a first look; the bundle method where contact
forces or pressures are judged. Two objectives on one scene prove no more than that.
"""

SETTINGS = f"""\
## Settings

Bundle: tolerance 1e-4. In scaled values and variables: SLSQP ftol 1e-6; trust-constr xtol and gtol 1e-5,
first radius 0.3; COBYLA rhobeg 0.1, tol 1e-4. A design counts if it violates no constraint by more than
{ALLOWED:g} widths of the box. At most 150 evaluations (COBYLA 300), on the small chain 80 (COBYLA left out).
"""


def above_best(run: dict[str, Any], runs: list[dict[str, Any]]) -> float:
    """Return by how much a method's value lies above the best on this problem, relative to it."""
    best = min(other["value"] for other in runs if other["case"] == run["case"])
    return float((run["value"] - best) / abs(best))


def _unit(run: dict[str, Any]) -> str:
    return "N mm" if run["objective"] == "total potential" else "N"


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
    handles, labels = grid[-1][0].get_legend_handles_labels()
    if len(cases) > 1:
        handles, labels = grid[0][0].get_legend_handles_labels()
    figure.legend(handles, labels, loc="outside lower center", ncols=len(labels), frameon=False)
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
    write_text(folder / "README.md", page(study))
    plot(folder / "optimisers.png", study["runs"])


CODE = (ROOT / "benchmarks" / "cases", Path(__file__).parent)
study = Study(jobs, write, HOME, CODE)
