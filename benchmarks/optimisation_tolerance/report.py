"""The study: its jobs, the tables of its page and its picture."""

from __future__ import annotations

import json
from pathlib import Path
from typing import Any

import matplotlib
import numpy as np

matplotlib.use("Agg")
from matplotlib import pyplot as plt

from benchmarks.study import ROOT, Records, Study, filled, found, unfilled
from fenics_contact.output import versions, write_json, write_text
from fenics_contact.study.report import table
from fenics_contact.study.runner import Job

ORANGE, BLUE, GREEN = "#f58518", "#4c78a8", "#54a24b"
#: What the adaptive runs are compared with.
USUAL = "1e-08"


def tables(studies: list[dict[str, Any]]) -> dict[str, str]:
    """Return the tables of the page by their names."""
    return {
        f"{study['size']} chain": "\n".join([_errors(study), _wrong(study), _optima(study)])
        for study in studies
    }


def _errors(study: dict[str, Any]) -> str:
    rows = []
    for tolerance in sorted({row["tolerance"] for row in study["errors"]}, reverse=True):
        mine = [row for row in study["errors"] if row["tolerance"] == tolerance]

        def largest(name: str, mine: list[dict[str, Any]] = mine) -> str:
            return f"{max(row[name] for row in mine):.1e}"

        ratio = np.median([row["estimate"] / row["value_error"] for row in mine])
        wrong = sum(row["wrong_status"] for row in mine)
        products = np.mean([row["products"] for row in mine])
        rows.append(
            (f"{tolerance:g}", largest("value_error"), f"{largest('estimate')} ({ratio:.2f})",
             largest("corrected_error"), largest("subgradient_error"), str(wrong), f"{products:.0f}")
        )  # fmt: skip
    head = ("tolerance", "value", "estimate", "corrected", "subgradient", "wrong status", "products")
    count = len({row["design"] for row in study["errors"]})
    return f"Largest errors over {count} designs, each solved cold; mean products.\n\n{table(head, rows)}\n"


def _wrong(study: dict[str, Any]) -> str:
    """Tell what a wrong face does to the subgradient."""
    rows = []
    for tolerance in (1e-1, 1e-2, 1e-3):
        mine = [row for row in study["errors"] if row["tolerance"] == tolerance]
        for face, wrong in (("right", False), ("wrong", True)):
            errors = [row["subgradient_error"] for row in mine if bool(row["wrong_status"]) is wrong]
            if errors:
                median, largest = f"{np.median(errors):.1e}", f"{max(errors):.1e}"
                rows.append((f"{tolerance:g}", face, str(len(errors)), median, largest))
    head = ("tolerance", "face", "designs", "subgradient, median", "largest")
    return table(head, rows) + "\n"


def _optima(study: dict[str, Any]) -> str:
    rows = []
    best = min(run["value"] for run in study["optima"])
    for run in study["optima"]:
        usual = next(
            other
            for other in study["optima"]
            if other["states"] == USUAL and other["stopping"] == run["stopping"]
        )
        above = (run["value"] - best) / (run["stopping"] * (1 + abs(best)))
        claimed = abs(run["value_claimed"] - run["value"]) / abs(run["value"])
        kinds = run["kinds"]
        evaluations = f"{sum(kinds.values())} ({kinds.get('refined', 0)})"
        rows.append(
            (f"{run['stopping']:g}", run["states"], f"{run['value']:.4f}", f"{above:.3f}", f"{claimed:.0e}",
             evaluations, str(run["products"]), f"{run['products'] / usual['products']:.2f}",
             f"{run['seconds_solving'] / usual['seconds_solving']:.2f}", run["reason"].lower())
        )  # fmt: skip
    head = (
        "ε", "states", "J of the optimum [N mm]", "above the best", "error of J claimed",
        "evaluations (again)", "products", "ratio to 1e-08", "time solving", "stop",
    )  # fmt: skip
    return table(head, rows) + "\n"


def plot(path: Path, study: dict[str, Any]) -> None:
    """Draw the errors by tolerance, and what the optimum costs."""
    figure, (left, right) = plt.subplots(1, 2, figsize=(11, 4.6), layout="constrained")
    _plot_errors(left, study["errors"])
    _plot_products(right, study["optima"])
    figure.suptitle(f"{study['size'].capitalize()} chain", fontsize="medium")
    figure.savefig(path, dpi=130)
    plt.close(figure)


def _plot_errors(axes: Any, rows: list[dict[str, Any]]) -> None:
    tolerances = sorted({row["tolerance"] for row in rows})
    for name, label, colour, marker in (
        ("value_error", "value", BLUE, "o"),
        ("corrected_error", "value, corrected by the adjoint", GREEN, "s"),
        ("subgradient_error", "subgradient", ORANGE, "^"),
    ):
        errors = [[row[name] for row in rows if row["tolerance"] == t] for t in tolerances]
        axes.loglog(tolerances, [max(each) for each in errors], marker=marker, color=colour, label=label)
        axes.fill_between(
            tolerances,
            [min(each) for each in errors],
            [max(each) for each in errors],
            color=colour,
            alpha=0.12,
        )
    axes.loglog(tolerances, tolerances, color="0.5", linestyle=":", label="tolerance itself")
    axes.set_xlabel("tolerance of the state")
    axes.set_ylabel("relative error (largest; band: all designs)")
    axes.set_ylim(bottom=1e-15)
    axes.grid(True, alpha=0.3)
    axes.legend(frameon=False, fontsize="small")
    axes.spines[["top", "right"]].set_visible(False)


def _plot_products(axes: Any, optima: list[dict[str, Any]]) -> None:
    names = list(dict.fromkeys(run["states"] for run in optima))
    place = np.arange(len(names))
    limits = sorted({run["stopping"] for run in optima}, reverse=True)
    for shift, (stopping, shade) in enumerate(zip(limits, (1.0, 0.5), strict=False)):
        runs = {run["states"]: run for run in optima if run["stopping"] == stopping}
        colours = [GREEN if "adaptive" in name else BLUE for name in names]
        heights = [runs[name]["products"] for name in names]
        bars = axes.bar(place + 0.4 * shift - 0.2, heights, 0.38, color=colours, alpha=shade)
        axes.bar_label(bars, fontsize="x-small", padding=2)
    axes.set_xticks(place, [name.replace(" from", "\nfrom") for name in names], fontsize="small")
    axes.set_xlabel("tolerance of the states")
    axes.set_ylabel("products of the minimisation")
    axes.set_title("stopping tolerance 1e-4 (full) and 1e-6 (pale)", fontsize="medium")
    axes.spines[["top", "right"]].set_visible(False)


HOME = ROOT / "docs" / "studies" / "optimisation_tolerance"
#: Size of the chain -> random designs beside the start, the optimum and one between them.
RANDOM = {"small": 20, "paper": 0}


def jobs(quick: bool) -> list[Job]:
    """Return a job for each size."""
    return [
        Job(
            size, "benchmarks.optimisation_tolerance.measuring:study",
            {"size": size, "random_designs": count, "few": quick or size == "paper"}, limit=4 * 3600.0,
        )
        for size, count in RANDOM.items()
        if size == "small" or not quick
    ]  # fmt: skip


def write(folder: Path, records: Records, quick: bool) -> None:
    """Write numbers, page and picture; sizes that were not measured keep their numbers."""
    before = [] if quick else json.loads((HOME / "results.json").read_text())["studies"]
    studies = {each["size"]: each for each in before}
    studies |= {size: found(measured[0]) for size, measured in records.items()}
    known = [studies[size] for size in RANDOM if size in studies]
    if records:
        write_json(folder / "results.json", {"studies": known, "versions": versions()})
    texts = tables(known)
    page = unfilled(texts) if quick else filled((HOME / "README.md").read_text(encoding="utf-8"), texts)
    write_text(folder / "README.md", page)
    plot(folder / "optimisation_tolerance.png", known[0])


CODE = (ROOT / "benchmarks" / "cases", Path(__file__).parent)
study = Study(jobs, write, HOME, CODE)
