"""Measure, and write the results: `python -m benchmarks [--quick] [--only NAME ...] [--report]`."""

from __future__ import annotations

import argparse
import signal
import sys
from collections.abc import Sequence
from dataclasses import replace
from pathlib import Path

from benchmarks.plan import WARM_UP, Run, all_runs, chosen
from benchmarks.plot import plot_results
from benchmarks.report import write_json, write_results
from benchmarks.row import Summaries
from benchmarks.running import ROOT, RunFailed, fingerprint, measure, raw_file, read
from benchmarks.summary import summarise
from fenics_contact.progress import Task, shown


def main(arguments: Sequence[str] | None = None) -> None:
    """Run the benchmark with the settings of the command line."""
    parser = argparse.ArgumentParser(prog="python -m benchmarks", description="Measure and write results.")
    parser.add_argument("--quick", action="store_true", help="only small runs, once each; results in output/")
    parser.add_argument(
        "--only", nargs="+", default=[], metavar="NAME", help="runs with this name or beginning"
    )
    parser.add_argument(
        "--report", action="store_true", help="measure nothing, write the results of raw files"
    )
    parser.add_argument("--again", action="store_true", help="measure also what was measured with this code")
    settings = parser.parse_args(arguments)
    signal.signal(signal.SIGTERM, lambda *_: sys.exit(143))  # so that the running case ends, too
    try:
        runs = chosen(settings.only, settings.quick)
    except ValueError as error:
        parser.error(str(error))
    mark = fingerprint()
    if settings.quick:
        runs, mark = [replace(run, repeats=1) for run in runs], f"{mark}-quick"
    failed = [] if settings.report else _measure_all(runs, mark, again=settings.again)
    # What one of several partial runs measured counts in all later reports.
    known = runs if settings.quick else all_runs()
    records = {run.name: read(run, mark) for run in known}
    summaries = Summaries({name: summarise(name, found) for name, found in records.items() if found})
    if not summaries:
        sys.exit("a report needs measurements of the present code, found none: run without --report first")
    folder = ROOT / "output" / "benchmarks" / "quick" if settings.quick else Path(__file__).parent
    folder.mkdir(parents=True, exist_ok=True)
    missing = write_results(folder, summaries)
    plot_results(folder / "results.png", summaries)
    print(f"results in {folder.relative_to(ROOT)}/")
    if missing:
        print(f"not measured or refused: {', '.join(missing)}")
    if failed:
        sys.exit(f"failed: {', '.join(failed)}")


def _measure_all(runs: Sequence[Run], mark: str, *, again: bool) -> list[str]:
    """Measure what is not there yet; return the names of the runs that failed."""
    files = {(run, repeat): raw_file(run, mark, repeat) for run in runs for repeat in range(run.repeats)}
    wanted = [key for key, path in files.items() if again or not path.exists()]
    failed: list[str] = []
    for run in WARM_UP if wanted else ():
        measure(run)
    # A run is repeated only after all others were measured: load that lasts a while then hits no run alone.
    ordered = sorted(wanted, key=lambda key: key[1])
    with shown(), Task("benchmarks", unit="runs", total=len(ordered)) as task:
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
