"""The study: its jobs and the tables of its page."""

from __future__ import annotations

import json
from collections.abc import Iterable, Sequence
from pathlib import Path
from statistics import mean
from typing import Any

from benchmarks.large_deformations.cost import WAYS
from benchmarks.large_deformations.ironing_meshes import TIMES
from benchmarks.large_deformations.rounded_meshes import DIES
from benchmarks.large_deformations.twisting import COLUMNS, PUBLISHED
from benchmarks.study import ROOT, Records, Study, filled, found
from fenics_contact.output import write_json, write_text
from fenics_contact.study.report import table
from fenics_contact.study.results import extrapolate
from fenics_contact.study.runner import Job

HOME, NAME = ROOT / "docs" / "studies", "large_deformations"
#: Cells along the region of equal cells below the ball, by their order and whether dilatations are means.
BALL = {(1, False): (4, 8, 12, 16), (1, True): (4, 8, 12), (2, False): (4, 6, 8)}
#: Those of which a limit is taken; the three of linear cells are halved twice.
LIMITS = {1: (4, 8, 16), 2: (4, 6, 8)}
#: Columns of the bed that is ironed.
IRONING = (48, 60, 72)
#: Those of the bed along which round dies are drawn.
ROUNDED = (48, 96)
#: Subdomains along an edge of the block whose load steps are counted, and Poisson's ratios.
PARTS, RATIOS = (2, 3, 4), (0.3, 0.45, 0.49, 0.4999)
#: What names a run of a kind.
KEYS = {
    "ball": ("order", "dilatations", "cells"),
    "ironing": ("discretisation", "columns"),
    "rounded": ("die", "discretisation", "columns"),
    "twisting": ("columns",),
    "cost": ("way", "parts", "ratio"),
}
#: Most seconds that a job may take.
LIMIT = 7200.0

Run = dict[str, Any]


def converged(cells: Sequence[int], values: Sequence[float]) -> tuple[float, float]:
    """Return the limit of the three finest meshes and its error bar.

    The bar is how far the finest mesh is from the limit; where the values do not converge at a rate, the
    limit is the finest mesh's and the bar the largest difference of the three.
    """
    limit = extrapolate([1.0 / each for each in cells], values)
    last = list(values)[-3:]
    bar = max(last) - min(last) if limit.rate is None else abs(limit.value - last[-1])
    return limit.value, bar


def force(runs: Sequence[Run]) -> tuple[float, float]:
    """Return the ball's converged force: of quadratic cells, its bar reaching that of linear ones."""
    linear, (value, bar) = (
        converged(LIMITS[order], [_force_on(runs, order, cells) for cells in LIMITS[order]])
        for order in (1, 2)
    )
    return value, max(bar, abs(linear[0] - value))


def _force_on(runs: Sequence[Run], order: int, cells: int) -> float:
    wanted = (order, "points", cells)
    (value,) = (run["force"] for run in runs if tuple(run[key] for key in KEYS["ball"]) == wanted)
    return float(value)


def tables(record: dict[str, list[Run]]) -> dict[str, str]:
    """Return the tables of the page by their names."""
    return {
        "ball": _ball(record["ball"]),
        "ironing": _ironing(record["ironing"]),
        "rounded": _rounded(record["rounded"]),
        "twisting": _twisting(record["twisting"]),
        "cost": _cost(record["cost"]),
    }


def _ball(runs: list[Run]) -> str:
    head = ("order", "cells to the end of the fine region", "dofs of the quarter", "closed nodes", "force")
    rows = [
        (
            f"{run['order']}{', mean dilatations' * (run['dilatations'] == 'means')}", str(run["cells"]),
            str(run["dofs"]), str(run["closed"]), f"{run['force']:.3f}",
        )
        for run in runs
    ]  # fmt: skip
    value, bar = force(runs)
    rows.append(("", "limit", "", "", f"**{value:.1f} ± {bar:.1f}**"))
    return table(head, rows) + "\n"


def _ironing(runs: list[Run]) -> str:
    head = ["columns of the bed", "contact by", "force", *(f"t = {time:g}" for time in TIMES)]
    rows = []
    for way in dict.fromkeys(run["discretisation"] for run in runs):
        mine = [run for run in runs if run["discretisation"] == way]
        columns = [run["columns"] for run in mine]
        for part in ("vertical", "horizontal"):
            values = [[each[part] for each in run["times"]] for run in mine]
            rows += [
                (str(count), way, part, *_padded(f"{value:.1f}" for value in line))
                for count, line in zip(columns, values, strict=True)
            ]
            limits = [converged(columns, at) for at in zip(*values, strict=True)]
            rows.append(
                ("limit", way, part, *_padded(f"**{value:.1f} ± {bar:.1f}**" for value, bar in limits))
            )
        ripples = [
            max(at) for at in zip(*([each["ripple"] for each in run["times"]] for run in mine), strict=True)
        ]
        rows.append(("", way, "ripple", *_padded(f"{ripple:.1f}" for ripple in ripples)))
    return table(head, rows) + "\n"


def _cost(runs: list[Run]) -> str:
    head = (
        "subdomains", "unknowns", "ν", "done", "products at small strain", "in the load steps", "mean ratio",
        "factorisations", "mean",
    )  # fmt: skip
    rows = [
        (
            str(run["parts"] ** 3),
            str(run["unknowns"]),
            str(run["ratio"]),
            run["way"],
            str(run["small_products"]),
            " ".join(map(str, run["products"])),
            f"**{mean(run['products']) / run['small_products']:.2f}**",
            " ".join(map(str, run["factorisations"])),
            f"**{mean(run['factorisations']):.1f}**",
        )
        for run in runs
    ]
    return table(head, rows) + "\n"


def _rounded(runs: list[Run]) -> str:
    """Forces, and beside them by how much they differ from GetFEM's on the same mesh."""
    forces = ("pressed", "vertical", "horizontal")
    head = ("die", "columns of the bed", "contact by", *forces, "load steps", "Newton steps", "seconds")
    theirs = {(run["die"], run["columns"]): run for run in runs if run["discretisation"] == "GetFEM"}
    rows = []
    for run in sorted(runs, key=lambda run: (run["die"], run["columns"], run["discretisation"])):
        other = theirs[run["die"], run["columns"]]
        values = [f"{run[name]:.2f} ({100 * (run[name] / other[name] - 1):+.1f} %)" for name in forces]
        if run is other:
            values = [f"{run[name]:.2f}" for name in forces]
        counts = (str(run[name]) for name in ("load_steps", "newton_steps", "seconds"))
        rows.append((run["die"], str(run["columns"]), run["discretisation"], *values, *counts))
    return table(head, rows) + "\n"


def moments(run: Run) -> dict[int, float]:
    """Return the moments of a run at the published angles, in degrees."""
    return {step["angle"]: step["moment"] for step in run["steps"] if step["angle"] in PUBLISHED}


def _twisting(runs: list[Run]) -> str:
    head = ["moment", "dofs", *(f"{angle}°" for angle in PUBLISHED), "Newton steps", "seconds"]
    rows = []
    for run in runs:
        newton_steps = sum(step["newton_steps"] for step in run["steps"])
        values = (f"{value:.3f}" for value in moments(run).values())
        name = f"{run['columns']} columns"
        rows.append((name, str(run["dofs"]), *values, str(newton_steps), str(run["seconds"])))
    for place, name in enumerate(("Sauer and De Lorenzis", "FEBio")):
        rows.append((name, "", *(f"{values[place]:.3f}" for values in PUBLISHED.values()), "", ""))
        for run in runs:
            apart = (
                f"{100 * (value / PUBLISHED[angle][place] - 1):+.1f} %"
                for angle, value in moments(run).items()
            )
            rows.append((f"{run['columns']} columns beside it", "", *apart, "", ""))
    return table(head, rows) + "\n"


def _padded(words: Iterable[str]) -> list[str]:
    """Return the words of a line with empty ones for times at which nothing was measured."""
    known = list(words)
    return known + [""] * (len(TIMES) - len(known))


def jobs(quick: bool) -> list[Job]:
    """Return a job for every mesh and every count; the quick study has the coarsest ones."""
    room = f"benchmarks.{NAME}"
    balls = [
        Job(
            f"ball {order} {'means' if means else 'points'} {cells}", f"{room}.ball_on_metal:measured",
            {"cells": cells, "order": order, "means": means}, limit=LIMIT,
        )
        for (order, means), meshes in BALL.items()
        for cells in meshes
    ]  # fmt: skip
    dies = [
        Job(
            f"ironing {way} {columns}", f"{room}.ironing:measured",
            {"columns": columns, "discretisation": way}, limit=LIMIT,
        )
        for way in ("node", "mortar")
        for columns in IRONING
    ]  # fmt: skip
    others = [
        Job(
            f"ironing GetFEM {columns}", f"{room}.getfem_ironing:measured", {"columns": columns}, ranks=0,
            limit=LIMIT,
        )
        for columns in IRONING
    ]  # fmt: skip
    ours = [
        Job(
            f"rounded {die} {way} {columns}", f"{room}.rounded:measured",
            {"columns": columns, "die": die, "discretisation": way}, limit=LIMIT,
        )
        for die in DIES
        for way in ("node", "mortar")
        for columns in ROUNDED
    ]  # fmt: skip
    theirs = [
        Job(
            f"rounded {die} GetFEM {columns}", f"{room}.getfem_rounded:measured",
            {"columns": columns, "die": die}, ranks=0, limit=LIMIT,
        )
        for die in DIES
        for columns in ROUNDED
    ]  # fmt: skip
    costs = [
        Job(
            f"cost {way} {parts} {ratio}", f"{room}.cost:measured",
            {"parts": parts, "ratio": ratio, "way": way}, limit=LIMIT,
        )
        for way in WAYS
        for parts in PARTS
        for ratio in RATIOS
    ]  # fmt: skip
    twists = [
        Job(f"twisting {columns}", f"{room}.twisting:measured", {"columns": columns}, limit=LIMIT)
        for columns in COLUMNS
    ]
    return [balls[0], costs[0]] if quick else [*balls, *dies, *others, *ours, *theirs, *twists, *costs]


def write(folder: Path, records: Records, quick: bool) -> None:
    """Write numbers and page; what was not measured keeps its numbers."""
    new = {name: found(runs[0]) for name, runs in records.items() if "skipped" not in runs[0]}
    if quick:
        write_json(folder / f"{NAME}.json", new)
        return
    before = json.loads((HOME / f"{NAME}.json").read_text())
    known = {_name(kind, run): run for kind in KEYS for run in before[kind]} | new
    record: dict[str, list[Run]] = {kind: [] for kind in KEYS}
    for job in jobs(quick):
        if job.name in known:
            record[job.name.partition(" ")[0]].append(known[job.name])
    if records:
        write_json(folder / f"{NAME}.json", record)
    page = (HOME / f"{NAME}.md").read_text(encoding="utf-8")
    write_text(folder / f"{NAME}.md", filled(page, tables(record)))


def _name(kind: str, run: Run) -> str:
    return " ".join([kind, *(str(run[key]) for key in KEYS[kind])])


study = Study(jobs, write, HOME, (Path(__file__).parent,))
