"""The results as JSON, as a Markdown table, and as a plot."""

from __future__ import annotations

import json
from collections.abc import Sequence
from pathlib import Path
from typing import Any

from benchmarks.comparing import force_difference
from benchmarks.row import NoValue, Record, Row, Summaries, unknowns
from benchmarks.targets import ROWS, newton_names

Result = tuple[Row, dict[str, Any]]


def results(summaries: Summaries) -> tuple[list[Result], list[str]]:
    """Return the rows that can be computed, in the order of the table, and the names of the others."""
    found: list[Result] = []
    missing = []
    for row in ROWS:
        try:
            found.append((row, row.record(summaries)))
        except NoValue:
            missing.append(row.name)
    return found, missing


def write_text(path: Path, text: str) -> None:
    """Write a file whole or not at all."""
    path.parent.mkdir(parents=True, exist_ok=True)
    temporary = path.with_name(f".{path.name}.tmp")
    temporary.write_text(text, encoding="utf-8")
    temporary.replace(path)


def write_json(path: Path, data: Any) -> None:
    """Write a JSON file whole or not at all."""
    write_text(path, json.dumps(data, indent=2, ensure_ascii=False, allow_nan=False) + "\n")


def write_results(folder: Path, summaries: Summaries) -> list[str]:
    """Write ``results.json`` and ``results.md`` and return the names of the rows that are missing."""
    found, missing = results(summaries)
    write_json(folder / "results.json", [record for _, record in found])
    sections = [
        "# Results",
        "Written by `make benchmark`. Seconds and memory are medians; memory is the sum over the ranks.",
        targets_table(found),
        f"Not measured or refused: {', '.join(missing)}." if missing else "",
        "## Every run",
        runs_table(summaries),
        "## The chain by phase",
        phases_table(summaries),
        "## The block beside other solvers",
        blocks_table(summaries),
        "![Seconds an unknown by phase, and the block beside other solvers](results.png)",
    ]
    write_text(folder / "results.md", "\n\n".join(section for section in sections if section) + "\n")
    return missing


def table(head: Sequence[str], body: Sequence[Sequence[str]]) -> str:
    """Return a Markdown table."""
    lines = [head, ["---"] * len(head), *body]
    return "\n".join(f"| {' | '.join(line)} |" for line in lines)


def targets_table(found: Sequence[Result]) -> str:
    """Return what was wanted and what was measured."""
    sign = {"lower": "≤", "higher": "≥"}
    body = [
        (
            row.quantity,
            f"{record['value']:.3g} {row.unit}",
            f"{sign[row.better]} {row.target:g}",
            "yes" if row.met(record["value"]) else "**no**",
            str(record["ranks"]),
            f"{record['unknowns']:,}".replace(",", " "),
            row.comparison,
        )
        for row, record in found
    ]
    return table(("quantity", "measured", "target", "met", "ranks", "unknowns", "for comparison"), body)


def runs_table(summaries: Summaries) -> str:
    """Return seconds, memory and load of every run."""
    head = ("run", "ranks", "unknowns", "products", "seconds", "memory", "above the imports", "load", "runs")
    return table(head, [_run_line(name, run) for name, run in summaries.items()])


def _run_line(name: str, run: Record) -> tuple[str, ...]:
    load, repeats = f"{run['load_average']:.1f}", str(run["repeats"])
    if "skipped" in run or "refused" in run:
        why = f"refused: {run['refused']}" if "refused" in run else "skipped"
        return (name, "", "", why, "", "", "", load, repeats)
    counts = run.get("counts", {})
    products = counts.get("f_products", counts.get("products", ""))
    return (
        name,
        str(run["ranks"]),
        str(unknowns(run)) if counts else "",
        str(products),
        f"{run['seconds']:.2f}" if "seconds" in run else "",
        f"{run['peak_memory'] / 1e6:.0f} MB",
        f"{(run['peak_memory'] - run['import_memory']) / 1e6:.0f} MB",
        load,
        repeats,
    )


def chain_sizes(summaries: Summaries) -> dict[str, Record]:
    """Return the runs of the chain by size that were measured."""
    names = ("chain", "chain-refined-2", "chain-refined-3")
    return {name: summaries[name] for name in names if name in summaries}


def phases_table(summaries: Summaries) -> str:
    """Return microseconds an unknown by phase for each size of the chain, and seconds on one rank."""
    runs = {**{n: summaries[n] for n in ("chain-1-rank",) if n in summaries}, **chain_sizes(summaries)}
    if not runs:
        return "Not measured."
    phases = list(next(iter(runs.values()))["phases"])
    body = []
    for phase in phases:
        spent = {name: run["phases"][phase] for name, run in runs.items()}
        body.append((phase, *(f"{s:.2f} s, {1e6 * s / unknowns(runs[n]):.1f} µs" for n, s in spent.items())))
    spent = {name: run["seconds"] for name, run in runs.items()}
    whole = (f"{s:.2f} s, {1e6 * s / unknowns(runs[n]):.1f} µs" for n, s in spent.items())
    return table(("phase: seconds, microseconds an unknown", *runs), [*body, ("**whole**", *whole)])


def blocks_table(summaries: Summaries) -> str:
    """Return seconds and memory of each solver of the block, and how far forces differ."""
    body = []
    for size in ("28k", "92k", "212k"):
        for name in (f"block-{size}", *newton_names(size), f"getfem-{size}"):
            run = summaries.get(name)
            if run is None:
                continue
            if "skipped" in run:
                body.append((name, "", run["skipped"], "", ""))
                continue
            steps = run["counts"].get("newton_steps", run["counts"].get("solver_steps"))
            memory = f"{run['peak_memory'] / 1e6:.0f} MB"
            ours = summaries.get(f"block-{size}")
            apart = f"{force_difference(ours, run):.1e}" if ours and "forces" in run else ""
            body.append((name, str(unknowns(run)), f"{run['seconds']:.2f} s in {steps} steps", memory, apart))
    head = ("run", "unknowns", "seconds", "memory", "forces differ by")
    return table(head, body) if body else "Not measured."
