"""The study: its jobs, the table of its page and its figure."""

from __future__ import annotations

import json
from pathlib import Path
from typing import Any

import matplotlib
import numpy as np

matplotlib.use("Agg")
from matplotlib import pyplot as plt
from matplotlib.ticker import NullFormatter

from benchmarks.adaptive.cases import CASES
from benchmarks.study import ROOT, Records, Study, filled, found, unfilled
from fenics_contact.output import versions, write_json, write_text
from fenics_contact.study.report import table
from fenics_contact.study.runner import Job

HOME = ROOT / "docs" / "studies" / "adaptive"
#: Way -> colour, symbol, and what the figure calls it.
LOOKS = {
    "adaptive": ("#0072b2", "o", "refined where it pays, seconds of all meshes so far"),
    "uniform": ("#d55e00", "s", "refined everywhere, seconds of this state alone"),
}
Mesh = dict[str, float]


def errors(case: dict[str, Any], way: str, quantity: str) -> list[float]:
    """Return the relative errors of all meshes."""
    exact = case["exact"][quantity]
    return [abs(mesh["value"] / exact - 1.0) for mesh in case[way][quantity]]


def reached(case: dict[str, Any], way: str, quantity: str, aim: float) -> Mesh | None:
    """Return the first mesh from which on all errors are at most the aim."""
    above = np.flatnonzero(np.array(errors(case, way, quantity)) > aim)
    first = above[-1] + 1 if len(above) else 0
    meshes: list[Mesh] = case[way][quantity]
    return meshes[first] if first < len(meshes) else None


def order(case: dict[str, Any], way: str, quantity: str, largest: float = 0.05) -> float:
    """Return p of errors ~ unknowns^(−p) over the meshes with smaller errors than the largest.

    NaN if these are fewer than three.
    """
    unknowns = np.array([mesh["unknowns"] for mesh in case[way][quantity]])
    found = errors(case, way, quantity)
    small = np.array(found) <= largest
    if small.sum() < 3:
        return float("nan")
    return -float(np.polyfit(np.log(unknowns[small]), np.log(np.array(found)[small]), 1)[0])


def tables(study: dict[str, Any], aim: float = 0.01) -> dict[str, str]:
    """Return the tables of the page by their names."""
    head = (
        "case", "quantity", "adaptive: unknowns", "s", "order", "uniform: unknowns", "s", "order",
        "seconds, ratio", "unknowns, ratio",
    )  # fmt: skip
    rows = [_row(case, quantity, aim) for case in study["cases"] for quantity in case["exact"]]
    return {"one per cent": table(head, rows)}


def _row(case: dict[str, Any], quantity: str, aim: float) -> tuple[str, ...]:
    """Return a line; where uniform meshes do not reach the aim, their finest is shown, and what it has."""
    fine, coarse = (reached(case, way, quantity, aim) for way in LOOKS)
    beyond = ">" if coarse is None else ""
    last = coarse or case["uniform"][quantity][-1]
    missed = "" if coarse else f" ({100 * errors(case, 'uniform', quantity)[-1]:.2g} %)"
    ratios = [
        beyond + _two_digits(last[name] / fine[name]) if fine else "" for name in ("seconds", "unknowns")
    ]
    cost = (f"{fine['unknowns']}", f"{fine['seconds']:.2g}") if fine else ("not reached", "")
    orders = ["" if np.isnan(p := order(case, way, quantity)) else f"{p:.2f}" for way in LOOKS]
    title = CASES[case["case"]].title
    return (
        title, quantity, *cost, orders[0], f"{last['unknowns']}{missed}", f"{last['seconds']:.2g}", orders[1],
        *ratios,
    )  # fmt: skip


def _two_digits(number: float) -> str:
    """Return two significant digits without an exponent."""
    return f"{float(f'{number:.2g}'):g}"


def plot(path: Path, cases: list[dict[str, Any]]) -> None:
    """Draw error against seconds, and below it against unknowns, for every quantity."""
    panels = [(case, quantity) for case in cases for quantity in case["exact"]]
    figure, axes = plt.subplots(
        2, len(panels), figsize=(2.7 * len(panels), 6.2), sharey="col", layout="constrained", squeeze=False
    )
    for column, (case, quantity) in zip(axes.T, panels, strict=True):
        column[0].set_title(f"{CASES[case['case']].title}\n{quantity}", fontsize="medium")
        for row, (axis, measure) in enumerate(zip(column, ("seconds", "unknowns"), strict=True)):
            _curves(axis, case, quantity, measure)
            axis.set_xlabel(("time (s)", "unknowns")[row])
    for row in axes:
        row[0].set_ylabel("relative error (%)")
    figure.legend(*axes[0, 0].get_legend_handles_labels(), loc="outside lower center", ncols=2, frameon=False)
    figure.savefig(path, dpi=110)
    plt.close(figure)


def _curves(axis: Any, case: dict[str, Any], quantity: str, measure: str) -> None:
    for way, (colour, marker, label) in LOOKS.items():
        x = [mesh[measure] for mesh in case[way][quantity]]
        y = 100.0 * np.array(errors(case, way, quantity))
        axis.loglog(x, y, color=colour, marker=marker, markersize=4, linewidth=1.4, label=label)
    axis.axhline(1.0, color="0.5", linestyle=":", linewidth=1.0)
    if measure == "unknowns":  # numbers within less than a decade would run into each other
        axis.xaxis.set_minor_formatter(NullFormatter())
    axis.grid(True, alpha=0.3)
    axis.spines[["top", "right"]].set_visible(False)


def jobs(quick: bool) -> list[Job]:
    """Return a job for every case; the quick study has those in the plane, once, on small meshes."""
    settings = {"repeats": 1, "share": 0.05} if quick else {}
    return [
        Job(name, "benchmarks.adaptive.measuring:study", {"name": name, **settings}, limit=3600.0)
        for name in CASES
        if not quick or name in {"discs", "punch", "bracket"}
    ]


def write(folder: Path, records: Records, quick: bool) -> None:
    """Write numbers, page and figure; cases that were not measured keep their numbers."""
    path = HOME / "results.json"
    before = json.loads(path.read_text())["cases"] if path.exists() and not quick else []
    known = {case["case"]: case for case in before} | {name: found(each[0]) for name, each in records.items()}
    cases = [known[name] for name in CASES if name in known]
    study: dict[str, Any] = {"cases": cases, "versions": versions()}
    if records:
        write_json(folder / "results.json", study)
    texts = tables(study)
    page = unfilled(texts) if quick else filled((HOME / "README.md").read_text(encoding="utf-8"), texts)
    write_text(folder / "README.md", page)
    plot(folder / "adaptive.png", cases)


study = Study(jobs, write, HOME, (Path(__file__).parent,))
