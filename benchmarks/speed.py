"""The benchmark: what states, design steps and optimisations cost, beside what a user would write instead."""

from __future__ import annotations

from pathlib import Path

from benchmarks.plan import WARM_UP, runs
from benchmarks.plot import plot_results
from benchmarks.report import broken, page, results
from benchmarks.study import ROOT, Records, Study
from benchmarks.targets import Summaries
from fenics_contact.io import json_text
from fenics_contact.io.replacing import replacing
from fenics_contact.study.runner import summarised


def summaries_of(records: Records) -> Summaries:
    """Return one record for each run."""
    return {name: summarised(name, found) for name, found in records.items()}


def write_results(folder: Path, summaries: Summaries) -> None:
    """Write table, picture and numbers, ``results.md``, ``.png`` and ``.json``, all three or none."""
    with replacing(*(folder / f"results.{kind}" for kind in ("md", "png", "json"))) as (text, picture, data):
        text.write_text(page(summaries), encoding="utf-8")
        plot_results(picture, summaries)
        data.write_text(json_text([record for _, record in results(summaries)[0]]), encoding="utf-8")


study = Study(
    runs,
    lambda folder, records, _: write_results(folder, summaries_of(records)),
    home=Path(__file__).parent,
    code=(ROOT / "benchmarks" / "cases", ROOT / "demos"),
    complete=True,
    check=lambda records: broken(summaries_of(records)),
    warm_up=WARM_UP,
)
