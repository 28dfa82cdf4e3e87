"""Write the study: `python -m benchmarks.true_surfaces [--draw | --links]`; it goes to docs/studies/."""

from __future__ import annotations

import argparse
import json
from pathlib import Path

from benchmarks.true_surfaces.cases import CASES
from benchmarks.true_surfaces.links import links
from benchmarks.true_surfaces.measuring import BY_MORTAR, refined, study
from benchmarks.true_surfaces.orders import SURFACES, gap_errors
from benchmarks.true_surfaces.report import page
from fenics_contact.io import write_json
from fenics_contact.io.replacing import write_text

PAGE = Path(__file__).resolve().parents[2] / "docs" / "studies" / "true_surfaces.md"


def main() -> None:
    """Measure, then write numbers and page."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--draw", action="store_true", help="the page from numbers that are there")
    parser.add_argument("--links", action="store_true", help="measure the chain of links alone")
    record, given = PAGE.with_suffix(".json"), parser.parse_args()
    if given.links:
        write_json(record, {**json.loads(record.read_text()), "links": links()})
    elif not given.draw:
        cases = []
        for name in CASES:
            for way in ("node", "mortar") if name in BY_MORTAR else ("node",):
                cases.append(study(name, way))
                print(f"{name}, {way}: measured", flush=True)
        gaps = [gap_errors(name) for name in SURFACES]
        write_json(record, {"cases": cases, "refined": refined(), "gaps": gaps, "links": links()})
    write_text(PAGE, page(json.loads(record.read_text())))
    print(f"page in {PAGE}")


if __name__ == "__main__":
    main()
