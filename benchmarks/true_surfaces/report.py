"""The study: its jobs and its page."""

from __future__ import annotations

import json
from pathlib import Path
from typing import Any

from benchmarks.study import ROOT, Records, Study, found
from benchmarks.true_surfaces.cases import CASES
from benchmarks.true_surfaces.links import RUNS
from benchmarks.true_surfaces.measuring import BY_MORTAR, WAYS
from benchmarks.true_surfaces.orders import CELLS, SURFACES
from fenics_contact.io import write_json, write_text
from fenics_contact.study.runner import Job
from fenics_contact.study.tables import table

NAMES = {"faceted": "facets", "reconstructed": "reconstructed", "best": "true"}

INTRODUCTION = """\
# What facets instead of true surfaces cost

A mesh knows a round surface by flat facets, which lie up to h²/8R inside it. Between round bodies that is
not small beside what closes. Here the same meshes, points and multipliers are solved with gaps measured
between the flat facets (`ContactPair(geometry="faceted")`), between surfaces reconstructed from the nodes
(`"reconstructed"`), and between the true surfaces that the meshes carry (`"best"`). Written by
`make study-surfaces`, which runs `python -m benchmarks true_surfaces`.

- *facets*: equal ones around a quarter of the circle of the master, a round body; *on the contact*: how many
  of them lie between its middle and its rim.
- Errors are relative: of the largest nodal pressure, and of `contact_area`. Contact is by nodes unless mortar
  is named, without friction, under a given force.
- The slave has a fine mesh, the same for all facets. In the first four cases it is soft and the master a
  thousand times as stiff, so that the master's cells count by their facets alone. Shaft and bush are of one
  material; there what remains with true surfaces is the error of the bush's cells, which are as coarse as its
  facets.
- Contacts of Hertz reach over a tenth of the radius; theory, which has parabolas on half spaces, is then
  itself wrong by up to a per cent.

How to read it: where the surfaces are true, the error does not depend on the facets. With flat facets the
pressure is that under an edge, and worst where bodies conform, although many more facets lie on the contact
there. Contact by mortar averages a wrong gap and is as wrong. From 16 facets on, reconstruction from the
nodes is as good as a shape that is known.
"""

REMARKS = {
    "crossed cylinders": "A half cylinder across a stiff one of the same radius, beside Hertz's theory.",
    "disc on a block": "A stiff disc on a block in plane strain, beside Hertz's theory.",
    "ball on a block": "A stiff ball on a block, beside Hertz's theory.",
    "ball in a seat": "A stiff ball in a spherical seat of 1.01 times its radius. Hertz's theory does not "
    "hold where contact reaches so far around: errors are against true surfaces on a mesh of half the size.",
    "shaft in a bush": "A shaft in a bush of 1.01 times its radius and of the same material, in plane "
    "strain, beside Persson's theory.",
}

ORDERS = f"""\
## By how much gaps are wrong

Gaps of 2000 points near each surface, root mean square error relative to its radius (of the link: to half
the thickness of its wire), for {", ".join(map(str, CELLS[:-1]))} and {CELLS[-1]} facets on 45 degrees (of the
link: on a sixth of the way around), and the order of convergence over the finest three. Reconstruction is of
the third order at least, one more where nodes are evenly spaced.
"""


LINKS = """\
## Two links of a chain

The links of the demo under 80 kN with friction 0.3, on the published mesh of 48 × 8 × 20 cells a link (size
1) and refined in all directions, with equal cells and with cells that shrink towards the spot, 2.5 being the
demo's grading. Hertz's theory, for half spaces without friction, says 4384 MPa on 27.4 mm². The graded meshes
converge to 4350 ± 10 MPa, 0.8 % less: links of 16 mm wire under a spot of 6 mm are no half spaces. Equal
cells are long and narrow there, three to the radius of the spot even at size 3; contact by mortar is right to
3 % at size 1 and 1 % from size 1.5 on, contact by nodes up to 6 % too high. The energy is one of the whole
links: for it equal cells are better, from which J = -20 260 ± 50 N mm is extrapolated.
"""


def page(study: dict[str, Any]) -> str:
    """Return the page of Markdown."""
    parts = [INTRODUCTION]
    for each in study["cases"]:
        mortar = each["discretisation"] == "mortar"
        parts.append(f"## {each['case'].capitalize()}{', by mortar' if mortar else ''}\n")
        parts += [] if mortar else [f"{REMARKS[each['case']]}\n"]
        parts.append(_errors(each["runs"]))
    parts += [_refined(study["refined"]), LINKS, _links(study["links"]), ORDERS, _orders(study["gaps"])]
    return "\n".join(parts)


def _errors(runs: list[dict[str, Any]]) -> str:
    quantities = {"peak": "pressure", "area": "area"}
    head = ["facets", "on the contact", "slave's facets there"]
    head += [f"{name}, {NAMES[way]}" for name in quantities.values() for way in WAYS]
    rows = []
    for run in runs:
        shares = [f"{100 * run[quantity][way]:+.1f} %" for quantity in quantities for way in WAYS]
        rows.append((str(run["facets"]), f"{run['on_contact']:.1f}", str(run["cells"]), *shares))
    return table(tuple(head), rows) + "\n"


def _refined(runs: list[dict[str, Any]]) -> str:
    """Show what a finer slave does."""
    text = (
        "## A finer slave\n\nThe disc with 16 facets on a block whose cells are halved twice: under the edge "
        "between two facets the pressure has no limit.\n\n"
    )
    return text + _errors(runs)


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
    write_text(folder / f"{NAME}.md", page(parts))


study = Study(jobs, write, HOME, (Path(__file__).parent,))
