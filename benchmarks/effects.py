"""What each effect costs in time and memory: `python -m benchmarks.effects`; the table goes to effects.md."""

from __future__ import annotations

import statistics
from pathlib import Path
from typing import Any

from benchmarks.cases.scene_data import LEVELS  # not from the case: its MPI would end the ranks
from benchmarks.plan import Run
from benchmarks.running import ROOT, measure
from fenics_contact.io import write_json
from fenics_contact.io.replacing import write_text
from fenics_contact.study.words import table

REPEATS = 5


def row(level: str, records: list[dict[str, Any]], before: dict[str, float]) -> tuple[str, ...]:
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


def main() -> None:
    """Measure every level and write the table."""
    measure(Run("warm-up", "effects", options=("--level", "sensitivity")))
    records: dict[str, list[dict[str, Any]]] = {level: [] for level in LEVELS}
    for _ in range(REPEATS):
        for level in LEVELS:
            records[level].append(measure(Run(level, "effects", options=("--level", level))))
            print(f"{level}: {records[level][-1]['seconds']:.2f} s", flush=True)
    before: dict[str, float] = {}
    head = (
        "effect", "equality + contact rows", "cone", "forms", "F-products", "seconds", "added", "MB", "added",
        "MB planned",
    )  # fmt: skip
    unknowns = records["none"][0]["counts"]["torn_unknowns"]
    load = max(record["load_average"] for found in records.values() for record in found)
    text = (
        "# What each effect adds\n\n"
        f"Two cubes upon each other, {unknowns} torn unknowns in 128 subdomains, two ranks, cold, compiled "
        f"forms at hand; medians of {REPEATS}, load at most {load:.1f}. Each line has the effects of those "
        "above; friction laws replace each other. MB are those of both ranks beyond their libraries. "
        "Written by `python -m benchmarks.effects`.\n\n"
        + table(head, [row(level, found, before) for level, found in records.items()])
        + "\n"
    )
    folder = Path(__file__).parent
    write_text(folder / "effects.md", text)
    write_json(folder / "effects.json", records)
    print(f"table in {(folder / 'effects.md').relative_to(ROOT)}")


if __name__ == "__main__":
    main()
