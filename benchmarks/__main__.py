"""Measure, and write the results: `python -m benchmarks [--quick] [--only NAME ...] [--report]`.

Results are replaced when all runs are there; those of some runs go to output/benchmarks/partial/.
"""

from __future__ import annotations

import argparse
import signal
import sys
from collections.abc import Sequence
from pathlib import Path

from benchmarks.files import write_results
from benchmarks.held import broken
from benchmarks.plan import WARM_UP, Run, chosen
from benchmarks.row import Summaries
from benchmarks.running import OUTPUT, RunFailed, fingerprint, measure, raw_file, read
from benchmarks.summary import summarise
from fenics_contact.io import write_json
from fenics_contact.progress import Task, show_progress

#: Where the results of the full benchmark are kept.
FOLDER = Path(__file__).parent


def main(arguments: Sequence[str] | None = None) -> None:
    """Run the benchmark with the settings of the command line."""
    parser = _settings()
    settings = parser.parse_args(arguments)
    signal.signal(signal.SIGTERM, lambda *_: sys.exit(143))  # so that the running case ends, too
    try:
        runs = chosen(settings.only, settings.quick)
    except ValueError as error:
        parser.error(str(error))
    mark = f"{fingerprint()}-quick" if settings.quick else fingerprint()
    failed = [] if settings.report else _measure_all(runs, mark, settings)
    wrong = [f"failed: {name}" for name in failed] + _report(runs, mark, settings, good=not failed)
    if wrong:
        sys.exit("\n".join(wrong))


def _report(runs: Sequence[Run], mark: str, settings: argparse.Namespace, *, good: bool) -> list[str]:
    """Write the results of all raw files; return what is wrong with their counts."""
    # What one of several partial runs measured counts in all later reports.
    known = {run.name: run for run in (*chosen([], settings.quick), *runs)}
    records = {name: read(run, mark, settings.folder) for name, run in known.items()}
    summaries = Summaries({name: summarise(name, found) for name, found in records.items() if found})
    if not summaries:
        return ["a report needs measurements of the present code, found none: run without --report first"]
    wrong = broken(summaries)
    folder = settings.folder / "quick" if settings.quick else FOLDER
    if wrong or not good or any(len(found) < known[name].repeats for name, found in records.items()):
        folder = settings.folder / "partial"
    missing = write_results(folder, summaries)
    print(f"results in {folder}/")
    if missing:
        print(f"not measured or refused: {', '.join(missing)}")
    return wrong


def _settings() -> argparse.ArgumentParser:
    """Return the parser of the command line."""
    parser = argparse.ArgumentParser(prog="python -m benchmarks", description="Measure and write results.")
    parser.add_argument("--quick", action="store_true", help="only small runs, once each")
    parser.add_argument(
        "--only", nargs="+", default=[], metavar="NAME", help="runs with this name or beginning"
    )
    parser.add_argument(
        "--report", action="store_true", help="measure nothing, write the results of raw files"
    )
    parser.add_argument("--again", action="store_true", help="measure also what was measured with this code")
    parser.add_argument(
        "--folder",
        type=Path,
        default=OUTPUT,
        help="for raw files and results; those of the full benchmark go to benchmarks/ when it is complete",
    )
    return parser


def _measure_all(runs: Sequence[Run], mark: str, settings: argparse.Namespace) -> list[str]:
    """Measure what is not there yet; return the names of the runs that failed."""
    every = [(run, repeat) for run in runs for repeat in range(run.repeats)]
    files = {(run, repeat): raw_file(run, mark, repeat, settings.folder) for run, repeat in every}
    wanted = [key for key, path in files.items() if settings.again or not path.exists()]
    failed: list[str] = []
    for run in WARM_UP if wanted else ():
        measure(run)
    # A run is repeated only after all others were measured: load that lasts a while then hits no run alone.
    ordered = sorted(wanted, key=lambda key: key[1])
    with show_progress(), Task("benchmarks", unit="runs", total=len(ordered)) as task:
        for number, (run, repeat) in enumerate(ordered):
            task.step(number, words=run.name)
            if run.name in failed:
                continue
            try:
                record = measure(run)
            except RunFailed as error:
                print(error, file=sys.stderr, flush=True)
                failed.append(run.name)
                continue
            write_json(files[run, repeat], record)
            told = record.get("seconds", record.get("refused", record.get("skipped", "")))
            told = f"{told:.2f} s" if isinstance(told, float) else told
            print(f"{run.name} {repeat + 1}/{run.repeats}: {told}", flush=True)
    return failed


if __name__ == "__main__":
    main()
