"""The study: its jobs and the tables of its page."""

from __future__ import annotations

import json
import math
from collections.abc import Mapping
from pathlib import Path
from typing import Any

import matplotlib.pyplot as plt
from mpi4py import MPI

from benchmarks.others import fretting, large, linear, plastic, ring, warm
from benchmarks.others.rows import Problem, Row
from benchmarks.study import ROOT, Records, Study, filled, found, unfilled
from fenics_contact.output import write_json, write_text
from fenics_contact.study.report import table
from fenics_contact.study.runner import Job

PROBLEMS = {
    "roller": Problem("Roller on a block, NAFEMS R0094-1", linear.roller_rows),
    "punch": Problem("Punch with a rounded edge, NAFEMS R0094-2", linear.punch_rows),
    "pin": Problem("Pin in a bore, SSNV127", linear.pin_rows),
    "flat punch": Problem("Flat punch on a slab, solids4foam", linear.flat_punch_rows),
    "tube": Problem("Tube that closes a gap, SSNA105", linear.tube_rows),
    "fretting": Problem("Fretting with bulk tension, Nowell and Hills", fretting.fretting_rows),
    "rubber": Problem("Rubber cylinder between plates, Sussman and Bathe", large.rubber_rows),
    "ring": Problem("Ring between plates, SSNP501 and SSNP502", ring.ring_rows),
    "billet": Problem("Billet through a die, SSNV504", large.billet_rows),
    "ball": Problem("Ball in a perfectly plastic block, SSNV506", plastic.ball_rows),
    "sheet": Problem("Sheet stretched by a hemisphere, SSNV501", plastic.sheet_rows),
    "joint": Problem("Heat through a pressed joint, MOOSE", warm.joint_rows),
    "annulus": Problem("Heat across an annular gap, MOOSE", warm.annulus_rows),
    "gap": Problem("Gap conductance, Abaqus", warm.obstacle_rows),
}
HOME, NAME = ROOT / "docs" / "studies", "others"
#: Problems of the quick study.
QUICK = ("tube", "joint", "annulus", "gap")


def measured(_: MPI.Comm, name: str) -> dict[str, Any]:
    """Solve a problem and return its rows."""
    return {"rows": [row.record for row in PROBLEMS[name].rows()]}


def jobs(quick: bool) -> list[Job]:
    """Return a job for every problem; the quick study has the cheap ones."""
    names = QUICK if quick else tuple(PROBLEMS)
    return [Job(name, "benchmarks.others.report:measured", {"name": name}, limit=1800.0) for name in names]


def row_of(record: Mapping[str, Any]) -> Row:
    """Return the row of a record."""
    return Row(**{**record, "levels": tuple((value, work) for value, work in record["levels"])})


def tables(study: Mapping[str, list[dict[str, Any]]]) -> dict[str, str]:
    """Return the tables of the page by their names: all problems, and products by mesh."""
    head = (
        "problem", "quantity", "ours", "reference", "by", "within", "others", "unknowns", "products",
        "processor seconds",
    )  # fmt: skip
    lines, levels = [], []
    for name, records in study.items():
        for row in map(row_of, records):
            known = not math.isnan(row.reference)
            within = ("yes" if row.agrees else "**no**") if known else ""
            reference = f"{row.reference:.6g}" + (
                f" ± {100 * row.margin:.2g} %" if row.margin >= 1e-3 else ""
            )
            ours = f"{row.value:.6g} ± {row.error:.1g}"
            lines.append(
                (
                    PROBLEMS[name].title, row.quantity, ours, reference if known else "",
                    row.source if known else "", within, row.others, f"{row.unknowns}",
                    f"{row.products}", f"{row.seconds:.1f}",
                )
            )  # fmt: skip
            if name == "punch":
                levels.append((row.quantity, ", ".join(str(products) for _, products in row.levels)))
    return {"problems": table(head, lines), "products": table(("quantity", "products by mesh"), levels)}


def plot(path: Path, study: Mapping[str, list[dict[str, Any]]]) -> None:
    """Draw the pressure at the punch's edge by mesh, and the force on the rubber cylinder by its closing."""
    figure, (left, right) = plt.subplots(1, 2, figsize=(8.4, 3.4), layout="constrained")
    for row, marker in zip(
        (row_of(each) for each in study["punch"] if "pressure" in each["quantity"]), "os", strict=True
    ):
        values = [value for value, _ in row.levels]
        left.plot(
            range(1, len(values) + 1),
            values,
            marker=marker,
            markersize=4,
            label=row.quantity.split(", ")[-1].split(" [")[0],
        )
    left.axhspan(230.0, 430.0, color="0.85", label="other codes")
    left.set(title="Punch with a rounded edge", xlabel="mesh of solve_to", ylabel="largest pressure (N/mm²)")
    ways, rows = zip(*((float(r["quantity"].split()[2]), row_of(r)) for r in study["rubber"]), strict=True)
    right.plot((0.0, *ways), (0.0, *(row.value for row in rows)), label="here")
    right.plot(
        ways, [row.reference for row in rows], "ks", markersize=5, fillstyle="none", label="Sussman and Bathe"
    )
    right.plot([200.0], [1.27], "r^", markersize=5, label="solids4foam")
    right.set(
        title="Rubber cylinder",
        xlabel="closing (mm)",
        ylabel="force (kN/mm)",
        xlim=(0.0, 210.0),
        ylim=(0.0, 1.55),
    )
    for axis in (left, right):
        axis.legend(frameon=False, fontsize="small")
        axis.grid(True, alpha=0.3)
        axis.spines[["top", "right"]].set_visible(False)
    figure.savefig(path, dpi=110)
    plt.close(figure)


def check(records: Records) -> list[str]:
    """Return which rows miss their reference."""
    rows = [(name, row_of(row)) for name, found_ in records.items() for row in found_[0]["rows"]]
    missed = [(name, row) for name, row in rows if not math.isnan(row.reference) and not row.agrees]
    return [
        f"{name}: {row.quantity} is {row.value:.6g} ± {row.error:.1g}, not {row.reference:.6g}"
        for name, row in missed
    ]


def write(folder: Path, records: Records, quick: bool) -> None:
    """Write numbers and page; problems that were not measured keep their numbers."""
    path = HOME / f"{NAME}.json"
    before = json.loads(path.read_text()) if path.exists() and not quick else {}
    known = before | {name: found(each[0])["rows"] for name, each in records.items()}
    study_ = {name: known[name] for name in PROBLEMS if name in known}
    if records:
        write_json(folder / f"{NAME}.json", study_)
    if not quick:
        plot(folder / f"{NAME}.png", study_)
    page = HOME / f"{NAME}.md"
    texts = tables(study_)
    write_text(
        folder / f"{NAME}.md", unfilled(texts) if quick else filled(page.read_text(encoding="utf-8"), texts)
    )


study = Study(jobs, write, HOME, (Path(__file__).parent,))
