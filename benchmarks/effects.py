"""What each effect costs in time and memory; the table goes to effects.md."""

from __future__ import annotations

import json
import statistics
from collections.abc import Sequence
from pathlib import Path
from typing import Any

from benchmarks.cases.scene_data import LEVELS
from benchmarks.plan import run
from benchmarks.study import ROOT, Records, Study
from fenics_contact.output import write_json, write_text
from fenics_contact.study.report import table
from fenics_contact.study.runner import Job

HOME, REPEATS = ROOT / "benchmarks", 5


def page(records: Records) -> str:
    """Return the page of Markdown."""
    before: dict[str, float] = {}
    head = (
        "effect", "equality + contact rows", "cone", "forms", "F-products", "seconds", "added", "MB", "added",
        "MB planned",
    )  # fmt: skip
    unknowns = records["none"][0]["counts"]["torn_unknowns"]
    load = max(record["load_average"] for found in records.values() for record in found)
    return (
        "# What each effect adds\n\n"
        f"Two cubes upon each other, {unknowns} torn unknowns in 128 subdomains, two ranks, cold, compiled "
        f"forms at hand; medians of {REPEATS}, load at most {load:.1f}. Each line has the effects of those "
        "above; friction laws replace each other. MB are those of both ranks beyond their libraries. "
        "Written by `python -m benchmarks effects`.\n\n"
        + table(head, [_row(level, found, before) for level, found in records.items()])
        + "\n"
    )


def _row(level: str, records: Sequence[dict[str, Any]], before: dict[str, float]) -> tuple[str, ...]:
    """Return one line of the table and note seconds and memory for the next one."""
    counts, first = records[0]["counts"], records[0]
    seconds = statistics.median(record["seconds"] for record in records)
    memory = statistics.median(record["peak_memory"] - record["import_memory"] for record in records)
    rows = counts["normal_multipliers"] + counts["tangential_multipliers"]
    line = (
        level, f"{counts['equality_multipliers']} + {rows}", first["cone"], str(first["forms"]),
        str(counts["f_products"]), f"{seconds:.2f}", f"{seconds - before.get('seconds', seconds):+.2f}",
        f"{memory / 1e6:.0f}", f"{(memory - before.get('memory', memory)) / 1e6:+.0f}",
        f"{first['expected_memory'] / 1e6:.0f}",
    )  # fmt: skip
    before.update(seconds=seconds, memory=memory)
    return line


def jobs(quick: bool) -> list[Job]:
    """Return a job for each level."""
    return [run(level, "effects", {"level": level}, repeats=1 if quick else REPEATS) for level in LEVELS]


def write(folder: Path, records: Records, _: bool) -> None:
    """Write numbers and page; where a level was not measured, the page of the numbers that are there."""
    if set(records) == set(LEVELS):
        write_json(folder / "effects.json", records)
    else:
        records = json.loads((HOME / "effects.json").read_text())
    write_text(folder / "effects.md", page(records))


study = Study(
    jobs, write, HOME, (ROOT / "benchmarks" / "cases",),
    warm_up=(run("sensitivity", "effects", {"level": "sensitivity"}),),
)  # fmt: skip
