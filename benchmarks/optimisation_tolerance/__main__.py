"""Write the study: `python -m benchmarks.optimisation_tolerance [--only SIZE]`; it goes to docs/studies/."""

from __future__ import annotations

import argparse
import json
from pathlib import Path

from benchmarks.optimisation_tolerance.measuring import study
from benchmarks.optimisation_tolerance.report import page, plot
from fenics_contact.io import versions, write_json
from fenics_contact.io.replacing import write_text

FOLDER = Path(__file__).resolve().parents[2] / "docs" / "studies" / "optimisation_tolerance"
#: Random designs beside the start, the optimum and one between them.
RANDOM = {"small": 20, "paper": 0}


def main() -> None:
    """Measure, then write numbers, page and picture; sizes that were not measured keep their numbers."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--quick", action="store_true", help="the small chain, few tolerances; in output/")
    parser.add_argument("--only", choices=("small", "paper"), help="one size, the other as it was")
    chosen = parser.parse_args()
    sizes = ["small"] if chosen.quick else [chosen.only] if chosen.only else ["small", "paper"]
    folder = Path("output") / "optimisation_tolerance" if chosen.quick else FOLDER
    known = folder / "results.json"
    measured = [study(size, RANDOM[size], few=chosen.quick or size == "paper") for size in sizes]
    before = json.loads(known.read_text())["studies"] if known.exists() else []
    studies = {each["size"]: each for each in (*before, *measured)}
    ordered = [studies[size] for size in ("small", "paper") if size in studies]
    write_json(known, {"studies": ordered, "versions": versions()})
    studies_read = json.loads(known.read_text())["studies"]
    write_text(folder / "README.md", page(studies_read))
    plot(folder / "optimisation_tolerance.png", studies_read[0])
    print(f"page in {folder / 'README.md'}")


if __name__ == "__main__":
    main()
