"""Judge random scenes: ``python -m tools.random_scenes --count 1000 --first 0``.

``scripts/launch.sh 2 python -m tools.random_scenes --kind deformed --processes 0`` solves twins on two ranks.
"""

from __future__ import annotations

import argparse
import json
import sys
from pathlib import Path

from mpi4py import MPI

from tools.random_scenes.judge import GOOD, Verdict
from tools.random_scenes.runner import JUDGES, judged, table, work


def main() -> int:
    """Judge and write a table; fail unless every scene was solved or refused."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--count", type=int, default=1000, help="how many scenes")
    parser.add_argument("--first", type=int, default=0, help="seed of the first")
    parser.add_argument("--seeds", type=int, nargs="*", help="these seeds and no others")
    parser.add_argument(
        "--processes", type=int, default=2, help="how many at a time; 0: on all ranks of this one, no limit"
    )
    parser.add_argument("--limit", type=float, default=60.0, help="seconds of processor time for one scene")
    parser.add_argument("--kind", choices=JUDGES, default="linear", help="which scenes")
    parser.add_argument("--output", type=Path, help="gets every verdict as it comes, a line of JSON")
    parser.add_argument("--worker", action="store_true", help=argparse.SUPPRESS)
    options = parser.parse_args()
    if options.worker:
        work(JUDGES[options.kind])
        return 0
    first = MPI.COMM_WORLD.rank == 0
    seeds = options.seeds or range(options.first, options.first + options.count)

    def told(verdict: Verdict) -> None:
        if not first:
            return
        _tell(verdict)
        if options.output:
            with options.output.open("a", encoding="utf-8") as lines:
                lines.write(json.dumps(verdict.written()) + "\n")

    verdicts = judged(seeds, options.processes, options.limit, told, options.kind)
    if first:
        print(table(verdicts))
    return int(any(verdict.outcome not in GOOD for verdict in verdicts))


def _tell(verdict: Verdict) -> None:
    if verdict.outcome not in GOOD:
        print(
            f"seed {verdict.seed}: {verdict.outcome.value}: {verdict.detail}\n    {verdict.words}", flush=True
        )


if __name__ == "__main__":
    sys.exit(main())
