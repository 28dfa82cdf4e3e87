"""The benchmark: what states, design steps and optimisations cost, beside what a user would write instead."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path

from benchmarks.plan import WARM_UP, runs
from benchmarks.plot import plot_results
from benchmarks.report import broken, page, results, work
from benchmarks.study import ROOT, Records, Study
from benchmarks.targets import Summaries
from fenics_contact.output.files import json_text, replacing
from fenics_contact.study.runner import Record, summarised

#: Runs whose names begin so do not take the same number of iterations every time: PETSc's multigrid adds what
#: other ranks send in the order in which it arrives.
VARYING = "gamg"


def summaries_of(records: Records) -> Summaries:
    """Return one record for each run, of counts that vary the middle one."""
    return {
        name: summarised(name, _with_middle_counts(found) if name.startswith(VARYING) else found)
        for name, found in records.items()
    }


def _with_middle_counts(records: Sequence[Record]) -> list[Record]:
    middle = sorted(records, key=lambda record: work(record) or 0)[len(records) // 2]
    return [{**record, "counts": middle.get("counts", {})} for record in records]


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
