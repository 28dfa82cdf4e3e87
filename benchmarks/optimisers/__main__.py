"""Write the study: `python -m benchmarks.optimisers [--quick] [--folder F]`; it goes to docs/studies/."""

from __future__ import annotations

import argparse
import json
from pathlib import Path

from benchmarks.optimisers.measuring import FULL, METHODS, QUICK, budget_of, run
from benchmarks.optimisers.report import page, plot
from fenics_contact.io import versions, write_json
from fenics_contact.io.replacing import write_text
from fenics_contact.study.scenes.chain_links import GRADING

FOLDER = Path(__file__).resolve().parents[2] / "docs" / "studies" / "optimisers"


def main() -> None:
    """Measure, then write numbers, page and picture; what was measured so far is kept in output/."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--quick", action="store_true", help="one problem, few evaluations; no conclusions")
    parser.add_argument("--folder", type=Path, help="where to write instead of docs/studies/optimisers")
    parser.add_argument("--resume", action="store_true", help="leave out what was measured before")
    parser.add_argument("--draw", action="store_true", help="page and picture from numbers that are there")
    chosen = parser.parse_args()
    folder = chosen.folder or (FOLDER if not chosen.quick else Path("output") / "optimisers")
    known = folder / "results.json"
    beside = chosen.folder or Path("output") / "optimisers"
    so_far = beside / ("quick_runs.json" if chosen.quick else "runs.json")
    runs = json.loads(so_far.read_text()) if chosen.resume and so_far.exists() else []
    there = {(each["case"], each["method"]) for each in runs}
    for case in () if chosen.draw else QUICK if chosen.quick else FULL:
        for method in METHODS:
            budget = budget_of(case, method, chosen.quick)
            if (case.name, method) in there or not budget:
                continue
            runs.append(run(case, method, budget))
            last = runs[-1]
            print(f"{case.name}, {method}: J = {last['value']:.2f}, {last['stop']}", flush=True)
            write_json(so_far, runs)
    if not chosen.draw:
        write_json(known, {"runs": runs, "quick": chosen.quick, "grading": GRADING, "versions": versions()})
    study = json.loads(known.read_text())
    write_text(folder / "README.md", page(study))
    plot(folder / "optimisers.png", study["runs"])
    print(f"page in {folder / 'README.md'}")


if __name__ == "__main__":
    main()
