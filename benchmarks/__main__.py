"""Measure, and write results: `python -m benchmarks [STUDY] [--quick] [--only NAME ...] [--report]`.

Results are replaced when all runs are there and none has failed; others go to output/benchmarks/partial/.
"""

from __future__ import annotations

import argparse
import importlib
import logging
import os
import signal
import sys
from collections.abc import Sequence
from pathlib import Path

from benchmarks.study import ROOT, Study, chosen
from fenics_contact.study.runner import Store, fingerprint, measure_all

#: Study -> module that defines it as ``study``.
STUDIES = {
    "speed": "benchmarks.speed",
    "adaptive": "benchmarks.adaptive.report",
    "constants": "benchmarks.constants.report",
    "effects": "benchmarks.effects",
    "large_deformations": "benchmarks.large_deformations.report",
    "optimisation_tolerance": "benchmarks.optimisation_tolerance.report",
    "optimisers": "benchmarks.optimisers.report",
    "others": "benchmarks.others.report",
    "peers": "benchmarks.peers.report",
    "refinement": "benchmarks.refinement",
    "true_surfaces": "benchmarks.true_surfaces.report",
}


def main(arguments: Sequence[str] | None = None) -> None:
    """Run a study with the settings of the command line."""
    parser = _parser()
    settings = parser.parse_args(arguments)
    signal.signal(signal.SIGTERM, lambda *_: sys.exit(143))  # so that the running case ends, too
    study: Study = importlib.import_module(STUDIES[settings.study]).study
    default = ROOT / "output" / "benchmarks"
    folder = settings.folder or (default if settings.study == "speed" else default / settings.study)
    jobs = study.jobs(settings.quick)
    try:
        wanted = chosen(jobs, settings.only)
    except ValueError as error:
        parser.error(str(error))
    places = (ROOT / "fenics_contact", *study.code)
    mark = fingerprint(path for place in places for path in place.rglob("*.py"))
    # What a quick study has measured, beside whatever else, is no part of a full one.
    store = Store(folder / "raw", f"{mark}-quick" if settings.quick else mark)
    for job in wanted if settings.again else ():
        store.forget(job)
    if not settings.report:
        measure_all(wanted, store, title=settings.study, warm_up=study.warm_up)
    wrong = _report(study, store, folder, quick=settings.quick)
    if wrong:
        sys.exit("\n".join(wrong))


def _report(study: Study, store: Store, folder: Path, *, quick: bool) -> list[str]:
    """Write the results of all records; return what is wrong with them."""
    jobs = study.jobs(quick)
    records = {job.name: store.records(job) for job in jobs}
    failed = {name: found[0]["failed"] for name, found in records.items() if found and "failed" in found[0]}
    good = {
        name: [record for record in found if "failed" not in record]
        for name, found in records.items()
        if found and name not in failed
    }
    if study.complete and not good and not failed:
        return ["a report needs measurements of the present code, found none: run without --report first"]
    wrong = [f"failed: {name}: {reason['message']}" for name, reason in failed.items()] + study.check(good)
    target = folder / "quick" if quick else study.home
    if wrong or (study.complete and not all(store.complete(job) for job in jobs)):
        target = folder / "partial"
    study.write(target, good, quick)
    print(f"results in {target}/")
    return wrong


def _parser() -> argparse.ArgumentParser:
    """Return the parser of the command line."""
    parser = argparse.ArgumentParser(prog="python -m benchmarks", description="Measure and write results.")
    parser.add_argument("study", nargs="?", choices=list(STUDIES), default="speed", help="what (speed)")
    parser.add_argument("--quick", action="store_true", help="only small runs, once each; in output/")
    parser.add_argument(
        "--only", nargs="+", default=[], metavar="NAME", help="runs with this name or beginning"
    )
    parser.add_argument(
        "--report", action="store_true", help="measure nothing, write the results of what is there"
    )
    parser.add_argument("--again", action="store_true", help="measure also what was measured with this code")
    parser.add_argument("--folder", type=Path, help="for measurements, quick and partial results")
    return parser


def set_environment(path: Path) -> None:
    """Take over the NAME=VALUE lines of a file: the environment that all commands have."""
    lines = [line for line in path.read_text(encoding="utf-8").splitlines() if line and line[0] != "#"]
    os.environ.update({name: value for name, _, value in (line.partition("=") for line in lines)})


if __name__ == "__main__":
    set_environment(ROOT / "scripts" / "environment")
    logging.getLogger("fenics_contact").addHandler(logging.StreamHandler(sys.stdout))
    logging.getLogger("fenics_contact").setLevel(logging.INFO)
    main()
