"""Products of shear, press fit and Hertz' ball under refinement; the table goes to refinement.md."""

from __future__ import annotations

import json
from pathlib import Path

from benchmarks.cases.refinement import MESHES
from benchmarks.plan import run
from benchmarks.study import ROOT, Records, Study
from fenics_contact.output import write_json, write_text
from fenics_contact.study.report import table
from fenics_contact.study.runner import Job

HOME = ROOT / "benchmarks"
#: Name of a job -> its scene and mesh.
NAMES = {
    f"{scene}-{level + 1}": (scene, level) for scene, all_ in MESHES.items() for level in range(len(all_))
}


def page(records: Records) -> str:
    """Return the page of Markdown."""
    head = ("scene", "torn unknowns", "subdomains", "Newton steps", "F-products", "seconds, ratio")
    return (
        "# What refinement costs\n\n"
        "Two blocks that do not match, pressed and sheared with μ = 0.3; a ring pressed on a shaft; a "
        "quarter of a ball on a block, cells graded 20 to 1 towards the contact. Default settings, "
        "mortar, one rank, cold. Seconds are those of the processor, relative to the first mesh. Written by "
        "`python -m benchmarks refinement`.\n\n" + table(head, [_row(name, records) for name in NAMES]) + "\n"
    )


def _row(name: str, records: Records) -> tuple[str, ...]:
    """Return one line of the table."""
    record, first = records[name][0], records[f"{NAMES[name][0]}-1"][0]
    counts = record["counts"]
    return (
        name, str(counts["torn_unknowns"]), str(counts["subdomains"]), str(counts["solver_steps"]),
        str(counts["f_products"]), f"{record['seconds'] / first['seconds']:.1f}",
    )  # fmt: skip


def jobs(quick: bool) -> list[Job]:
    """Return a job for each mesh; of the quick study the coarsest ones."""
    return [
        run(name, "refinement", {"scene": scene, "level": level}, 1, repeats=1)
        for name, (scene, level) in NAMES.items()
        if not quick or level == 0
    ]


def write(folder: Path, records: Records, quick: bool) -> None:
    """Write numbers and page; meshes that were not measured keep their numbers."""
    path = HOME / "refinement.json"
    known = {**(json.loads(path.read_text()) if path.exists() else {}), **records}
    if not quick:
        write_json(folder / "refinement.json", known)
    if set(known) >= set(NAMES):
        write_text(folder / "refinement.md", page(known))


study = Study(jobs, write, HOME, (ROOT / "benchmarks" / "cases",))
