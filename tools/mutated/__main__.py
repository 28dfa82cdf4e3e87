"""Spoil files and plan them: ``python -m tools.mutated --count 2000``."""

from __future__ import annotations

import argparse
import sys
import tempfile
from collections import Counter
from pathlib import Path

from tools.mutated.judging import judged
from tools.mutated.subjects import SUBJECTS


def main() -> int:
    """Judge and print what is wrong; fail if anything is."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--count", type=int, default=2000, help="how many files")
    parser.add_argument("--first", type=int, default=0, help="seed of the first")
    parser.add_argument("--only", default="", help="subjects whose names begin so")
    parser.add_argument("--keep", type=Path, help="folder that gets the last file")
    options = parser.parse_args()
    names = [name for name in SUBJECTS if name.startswith(options.only)]
    outcomes = Counter[str]()
    for number in range(options.first, options.first + options.count):
        name = names[number % len(names)]
        with tempfile.TemporaryDirectory() as place:
            verdict = judged(name, number, options.keep or Path(place))
        outcomes["trouble" if verdict.trouble else "planned" if verdict.code == 0 else "refused"] += 1
        if verdict.trouble or verdict.seconds > 10.0:
            last = [line for line in verdict.words.splitlines() if line.startswith("  File")][-1:]
            words = f"{verdict.trouble[:200]} {last}"
            print(f"{name}, seed {number}, {verdict.seconds:.1f} s: {words}", flush=True)
    print(dict(outcomes))
    return int(outcomes["trouble"] > 0)


if __name__ == "__main__":
    sys.exit(main())
