"""The results as a Markdown page."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

from benchmarks.comparing import Record, force_difference
from benchmarks.held import HELD
from benchmarks.plan import BLOCKS, LINEAR
from benchmarks.targets import ROWS, Row, Summaries, newton_names, unknowns
from fenics_contact.study.report import table

#: What the steps of a solver are called in its counts.
STEPS = ("newton_steps", "solver_steps", "iterations")

Result = tuple[Row, dict[str, Any]]


def results(summaries: Summaries) -> tuple[list[Result], list[str]]:
    """Return the rows that can be computed, in the order of the table, and the names of the others."""
    found: list[Result] = []
    missing = []
    for row in ROWS:
        try:
            found.append((row, row.record(summaries)))
        except KeyError:
            missing.append(row.name)
    return found, missing


def page(summaries: Summaries) -> str:
    """Return ``results.md``."""
    found, missing = results(summaries)
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
        "![Seconds per unknown by phase, and the block beside other solvers](results.png)",
    ]
    return "\n\n".join(section for section in sections if section) + "\n"


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
        )
        for row, record in found
    ]
    return table(("quantity", "measured", "target", "met", "ranks", "unknowns"), body)


def runs_table(summaries: Summaries) -> str:
    """Return seconds, memory and load of every run."""
    head = (
        "run",
        "ranks",
        "unknowns",
        "kinds of subdomains",
        "products or steps",
        "seconds",
        "memory",
        "above the imports",
    )
    return table((*head, "load", "runs"), [_run_line(name, run) for name, run in summaries.items()])


def _run_line(name: str, run: Record) -> tuple[str, ...]:
    load, repeats = f"{run['load_average']:.1f}", str(run["repeats"])
    if "skipped" in run or "refused" in run:
        why = f"refused: {run['refused']}" if "refused" in run else "skipped"
        return (name, "", "", "", why, "", "", "", load, repeats)
    counts = run.get("counts", {})
    return (
        name,
        str(run["ranks"]),
        str(unknowns(run)) if counts else "",
        f"{counts['kinds']} of {counts['subdomains']}" if "kinds" in counts else "",
        "" if work(run) is None else str(work(run)),
        f"{run['seconds']:.2f}" if "seconds" in run else "",
        f"{run['peak_memory'] / 1e6:.0f} MB",
        f"{(run['peak_memory'] - run['import_memory']) / 1e6:.0f} MB",
        load,
        repeats,
    )


def chain_sizes(summaries: Summaries) -> dict[str, Record]:
    """Return the runs of the chain by size that were measured, all cut as they are by default."""
    names = ("chain-default", "chain-refined-2", "chain-refined-3")
    return {name: summaries[name] for name in names if name in summaries}


def phases_table(summaries: Summaries) -> str:
    """Return seconds by phase for the chain in boxes on one and two ranks, and for each size of it."""
    boxes = {name: summaries[name] for name in ("chain-1-rank", "chain") if name in summaries}
    runs = {**boxes, **chain_sizes(summaries)}
    if not runs:
        return "Not measured."
    phases = list(next(iter(runs.values()))["phases"])
    spent = {phase: [run["phases"][phase] for run in runs.values()] for phase in phases}
    spent["**whole**"] = [run["seconds"] for run in runs.values()]
    sizes = [unknowns(run) for run in runs.values()]
    body = [
        (phase, *(f"{s:.2f} s, {1e6 * s / n:.1f} µs" for s, n in zip(seconds, sizes, strict=True)))
        for phase, seconds in spent.items()
    ]
    return table(("phase: seconds, microseconds per unknown", *runs), body)


def blocks_table(summaries: Summaries) -> str:
    """Return seconds and memory of each solver of the block, and how far forces differ."""
    body = []
    for size in BLOCKS:
        ours = f"block-{size}"
        others = (*newton_names(size), f"getfem-{size}", *(f"{solver}-{size}" for solver in LINEAR))
        for name in (ours, f"{ours}-boxes", *others):
            run = summaries.get(name)
            if run is None:
                continue
            if "skipped" in run:
                body.append((name, "", run["skipped"], "", ""))
                continue
            steps = next(run["counts"][key] for key in STEPS if key in run["counts"])
            memory = f"{run['peak_memory'] / 1e6:.0f} MB"
            known = ours in summaries and "forces" in run
            apart = f"{force_difference(summaries[ours], run):.1e}" if known else ""
            body.append((name, str(unknowns(run)), f"{run['seconds']:.2f} s in {steps} steps", memory, apart))
    head = ("run", "unknowns", "seconds", "memory", "forces differ by")
    return table(head, body) if body else "Not measured."


def work(run: Record) -> int | None:
    """Return products with F, steps of Newton's method or iterations: what a run counts."""
    counts = run.get("counts", {})
    names = ("f_products", "products", "newton_steps", "iterations")
    return next((counts[name] for name in names if name in counts), None)


def broken(summaries: Summaries) -> list[str]:
    """Return one sentence for each run whose counts are not those that are held."""
    found = []
    for name, held in HELD.items():
        run = summaries.get(name, {})
        spent = work(run)
        if spent is None:  # not measured, or skipped
            continue
        if unknowns(run) != held.unknowns or spent > held.margin * held.work:
            found.append(
                f"{name} must have {held.unknowns} unknowns and take {held.work} products or steps, got "
                f"{unknowns(run)} and {spent}: find out why, or hold the new counts in benchmarks/held.py"
            )
    return found
