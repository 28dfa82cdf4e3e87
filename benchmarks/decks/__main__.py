"""Solve CalculiX's test decks, and write a table: `python -m benchmarks.decks [NAME ...] [--folder F]`.

Each deck is solved here and, where CalculiX is installed, by it; else results are compared with the reference
files beside the decks. Decks that are not read are listed by reason.
"""

from __future__ import annotations

import argparse
import json
from collections import defaultdict
from collections.abc import Sequence
from pathlib import Path

from benchmarks.decks.running import FOLDER, Outcome, deck_names, outcome

#: Bounds of the columns that count decks.
CLOSE, NEAR = 1e-3, 1e-2


def main(arguments: Sequence[str] | None = None) -> None:
    """Solve decks, and write table and numbers."""
    parser = argparse.ArgumentParser(prog="python -m benchmarks.decks", description=__doc__)
    parser.add_argument("names", nargs="*", help="decks without .inp, all by default")
    parser.add_argument("--folder", type=Path, default=FOLDER, help="where the decks are")
    parser.add_argument("--output", type=Path, default=Path("output/benchmarks/decks"))
    parser.add_argument("--limit", type=float, default=120.0, help="processor seconds of a deck")
    parser.add_argument(
        "--refine", type=int, default=0, metavar="TIMES", help="cut each hexahedron into eight, so many times"
    )
    settings = parser.parse_args(arguments)
    names = settings.names or deck_names(settings.folder)
    found = []
    for name in names:
        found.append(outcome(settings.folder, name, settings.limit, times=settings.refine))
        print(found[-1].line, flush=True)
    settings.output.mkdir(parents=True, exist_ok=True)
    (settings.output / "decks.md").write_text(table(found))
    numbers = [vars(each) | {"agreement": vars(each.agreement)} for each in found]
    (settings.output / "decks.json").write_text(json.dumps(numbers, indent=1))
    print(summary(found))


def summary(found: Sequence[Outcome]) -> str:
    """Return how many decks are solved, and how well."""
    solved = [each for each in found if not each.refused]
    lines = []
    for contact, words in ((False, "without contact"), (True, "with contact")):
        mine = [each.agreement.worst for each in solved if each.contact == contact]
        known = [value for value in mine if value is not None]
        lines.append(
            f"{words}: {sum(each.contact == contact for each in found)} decks, {len(mine)} solved, "
            f"{sum(value <= CLOSE for value in known)} within 0.1 %, "
            f"{sum(value <= NEAR for value in known)} within 1 %"
        )
    return "\n".join(lines)


def table(found: Sequence[Outcome]) -> str:
    """Return the page: decks that are solved with their agreement, the others by reason."""
    rows = [
        "# CalculiX's test decks",
        "",
        summary(found),
        "",
        "Largest differences relative to the largest value, over all steps, of displacements, of forces on "
        "nodes along what supports hold, and of the mean stress of cells. Seconds are those of one core.",
        "",
        "| deck | displacement | force | stress | seconds | CalculiX |",
        "|---|---|---|---|---|---|",
    ]
    rows += [each.row for each in found if not each.refused]
    by_reason: dict[str, list[str]] = defaultdict(list)
    for each in found:
        if each.refused:
            by_reason[each.reason].append(each.name)
    rows += ["", "| refused | number | decks |", "|---|---|---|"]
    for reason, names in sorted(by_reason.items(), key=lambda pair: (-len(pair[1]), pair[0])):
        rows.append(f"| {reason} | {len(names)} | {', '.join(names)} |")
    return "\n".join(rows) + "\n"


if __name__ == "__main__":
    main()
