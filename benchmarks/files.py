"""The files of the results: table, picture and numbers, all three or none."""

from __future__ import annotations

import json
from pathlib import Path

from benchmarks.plot import plot_results
from benchmarks.report import page, results
from benchmarks.row import Summaries
from fenics_contact.io.json_file import plain
from fenics_contact.io.replacing import replacing


def write_results(folder: Path, summaries: Summaries) -> list[str]:
    """Write ``results.md``, ``results.png``, ``results.json``; return the names of rows without a value."""
    found, missing = results(summaries)
    with replacing(*(folder / f"results.{kind}" for kind in ("md", "png", "json"))) as (text, picture, data):
        text.write_text(page(summaries), encoding="utf-8")
        plot_results(picture, summaries)
        numbers = plain([record for _, record in found])
        data.write_text(json.dumps(numbers, indent=2, ensure_ascii=False, allow_nan=False) + "\n")
    return missing
