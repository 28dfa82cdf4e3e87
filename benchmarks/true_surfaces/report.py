"""The study: its jobs and the tables of its page."""

from __future__ import annotations

import json
from pathlib import Path
from typing import Any

from benchmarks.study import ROOT, Records, Study, filled, found
from benchmarks.true_surfaces.cases import CASES
from benchmarks.true_surfaces.links import RUNS
from benchmarks.true_surfaces.measuring import BY_MORTAR, WAYS
from benchmarks.true_surfaces.orders import CELLS, SURFACES
from fenics_contact.output import write_json, write_text
from fenics_contact.study.report import table
from fenics_contact.study.runner import Job

NAMES = {"faceted": "facets", "reconstructed": "reconstructed", "best": "true"}


def tables(study: dict[str, Any]) -> dict[str, str]:
    """Return the tables of the page by their names."""
    cases = {f"{each['case']}, {each['discretisation']}": _errors(each["runs"]) for each in study["cases"]}
    others = {"refined": _errors(study["refined"]), "links": _links(study["links"])}
    return {**cases, **others, "gaps": _orders(study["gaps"])}


def _errors(runs: list[dict[str, Any]]) -> str:
    quantities = {"peak": "pressure", "area": "area"}
    head = ["facets", "on the contact", "slave's facets there"]
    head += [f"{name}, {NAMES[way]}" for name in quantities.values() for way in WAYS]
    rows = []
    for run in runs:
        shares = [f"{100 * run[quantity][way]:+.1f} %" for quantity in quantities for way in WAYS]
        rows.append((str(run["facets"]), f"{run['on_contact']:.1f}", str(run["cells"]), *shares))
    return table(tuple(head), rows) + "\n"


def _orders(gaps: list[dict[str, Any]]) -> str:
    rows = []
    for each in gaps:
        for way in WAYS:
            misses = [f"{miss:.1e}" for miss in each["errors"][way]]
            rows.append((each["surface"], NAMES[way], *misses, f"{each['orders'][way]:.1f}"))
    return table(("surface", "taken for it", *map(str, CELLS), "order"), rows) + "\n"


def _links(runs: list[dict[str, Any]]) -> str:
    head = ("size", "grading", "contact by", "taken for it", "unknowns", "J [N mm]", "peak [MPa]")
    rows = [
        (
            f"{run['size']:g}", f"{run['grading']:g}" if run["grading"] else "none", run["discretisation"],
            NAMES[run["geometry"]], f"{run['unknowns']}", f"{run['potential']:.0f}", f"{run['peak']:.0f}",
            f"{run['area']:.1f}", f"{run['closed']}", f"{run['products']}",
        )
        for run in runs
    ]  # fmt: skip
    return table((*head, "area [mm²]", "closed points", "F-products"), rows) + "\n"


HOME, NAME = ROOT / "docs" / "studies", "true_surfaces"
#: Of the jobs of the links, by which the record knows them, too.
_LINK = ("size", "grading", "discretisation", "geometry")
#: Most seconds that a job may take.
LIMIT = 7200.0


def jobs(quick: bool) -> list[Job]:
    """Return a job for every case, every chain and every surface; the quick study has plane cases alone."""
    room = "benchmarks.true_surfaces"
    cases = [
        Job(
            f"case {name}, {way}", f"{room}.measuring:study", {"name": name, "discretisation": way},
            limit=LIMIT,
        )
        for name in CASES
        for way in (("node", "mortar") if name in BY_MORTAR else ("node",))
    ]  # fmt: skip
    if quick:
        return [job for job in cases if "disc" in job.name or "shaft" in job.name]
    links = [
        Job(
            f"link {', '.join(map(str, run))}", f"{room}.links:measured", dict(zip(_LINK, run, strict=True)),
            limit=LIMIT,
        )
        for run in RUNS
    ]  # fmt: skip
    gaps = [Job(f"gap {name}", f"{room}.orders:gap_errors", {"name": name}) for name in SURFACES]
    return [*cases, Job("refined", f"{room}.measuring:refined", limit=LIMIT), *gaps, *links]


def write(folder: Path, records: Records, quick: bool) -> None:
    """Write numbers and page; what was not measured keeps its numbers. Only the full study has a page."""
    new = {name: found(measured[0]) for name, measured in records.items()}
    if quick:
        write_json(folder / f"{NAME}.json", new)
        return
    before = json.loads((HOME / f"{NAME}.json").read_text())
    parts: dict[str, list[Any]] = {"cases": [], "refined": [], "gaps": [], "links": []}
    known = {f"case {case['case']}, {case['discretisation']}": case for case in before["cases"]}
    known |= {f"gap {each['surface']}": each for each in before["gaps"]}
    known |= {f"link {', '.join(str(each[name]) for name in _LINK)}": each for each in before["links"]}
    known |= new
    for job in jobs(quick):
        kind = job.name.partition(" ")[0]
        if job.name in known and kind != "refined":
            parts[f"{kind}s"].append(known[job.name])
    parts["refined"] = known.get("refined", {"runs": before["refined"]})["runs"]
    if records:
        write_json(folder / f"{NAME}.json", parts)
    page = (HOME / f"{NAME}.md").read_text(encoding="utf-8")
    write_text(folder / f"{NAME}.md", filled(page, tables(parts)))


study = Study(jobs, write, HOME, (Path(__file__).parent,))
