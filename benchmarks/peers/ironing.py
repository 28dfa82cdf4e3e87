"""Shallow ironing by all programs, to 5 mm; `benchmarks.large_deformations.ironing_meshes`.

Forces on the die, down and along, by time: pressed in until 1, drawn by 10 mm a unit of time from then on.
"""

from __future__ import annotations

import re
import subprocess
from time import process_time
from typing import Any

import numpy as np

from benchmarks.large_deformations import getfem_ironing
from benchmarks.large_deformations.ironing_meshes import (
    COARSER,
    FRICTION,
    HARD,
    RATIO,
    SOFT,
    bed,
    die,
    place,
)
from benchmarks.peers.calculix import _rows, mesh_cards, missing, solved
from benchmarks.peers.evaluation import Whole, taken
from benchmarks.peers.scenes import PeerScene
from fenics_contact.gallery.blocks import extrude

#: Columns of the bed, and the times whose forces are compared.
COLUMNS, TIMES = 48, (0.5, 1.0, 1.5)
#: Load steps of this package: pressed in quarters, drawn by a quarter of a millimetre each.
STEPS = (*np.linspace(0.25, 1.0, 4).tolist(), *np.linspace(1.025, 1.5, 20).tolist())


def ours(comm: Any, columns: int = COLUMNS) -> dict[str, Any]:
    """Return the record of this package, by mortar. Collective."""
    from benchmarks.large_deformations.ironing import held, ironing
    from fenics_contact import ContactProblem, LoadStep, solve_steps

    start = process_time()
    steps = [LoadStep(f"time {time:g}", supports=held(time)) for time in STEPS]
    states = solve_steps(ContactProblem(ironing(columns, "mortar"), comm), steps)
    record = taken(start, sum(len(state.solution.history) for state in states), True)
    forces = [state.reactions()[1].force for state in states]
    return {**record, "times": [_at(time, *forces[STEPS.index(time)]) for time in TIMES]}


def _at(time: float, along: float, down: float) -> dict[str, float]:
    return {"time": time, "vertical": round(abs(float(down)), 1), "horizontal": round(abs(float(along)), 1)}


def by_getfem(comm: None, columns: int = COLUMNS) -> dict[str, Any]:
    """Return the record of GetFEM by rays; while drawn, forces are means over a facet."""
    start = process_time()
    found = getfem_ironing.measured(None, columns)
    if "skipped" in found:
        return found
    known = {each["time"]: each for each in found["times"]}
    forces = [(known[time]["horizontal"], known[time]["vertical"]) for time in TIMES]
    record = taken(start, found["newton_steps"], True)
    return {**record, "times": [_at(time, *each) for time, each in zip(TIMES, forces, strict=True)]}


def deck(columns: int, stiffness: float) -> str:
    """Return the deck: one layer of hexahedra in plane strain; contact as soft as in `calculix`."""
    bodies = {"bed": extrude(bed(columns), [0.0, 1.0]), "die": extrude(die(columns // COARSER), [0.0, 1.0])}
    whole = Whole(PeerScene(bodies, SOFT, FRICTION, (), ("die", "skin"), ("bed", "y1")))
    lines = mesh_cards(whole.points, whole.cells)
    for name in bodies:
        lines += [
            f"*ELSET, ELSET={name.upper()}",
            *_rows([k + 1] for k in np.flatnonzero(whole.body == name)),
        ]
    for name, side in (("LOW", ("bed", "y0")), ("TOP", ("die", "y1"))):
        lines += [f"*NSET, NSET={name}", *_rows([node + 1] for node in whole.nodes(side))]
    for name, side in (("SLAVE", ("die", "skin")), ("MASTER", ("bed", "y1"))):
        faces = whole.faces(side)
        lines += [f"*SURFACE, NAME={name}, TYPE=ELEMENT", *_rows((c + 1, f"S{f + 1}") for c, f in faces)]
    for name, young in (("BED", SOFT), ("DIE", HARD)):
        shear, bulk = young / (2 * (1 + RATIO)), young / (3 * (1 - 2 * RATIO))
        lines += [f"*MATERIAL, NAME={name}", "*HYPERELASTIC, NEO HOOKE", f"{shear / 2},{2 / bulk}"]
        lines += [f"*SOLID SECTION, ELSET={name}, MATERIAL={name}"]
    lines += ["*SURFACE INTERACTION, NAME=TOUCH", "*SURFACE BEHAVIOR, PRESSURE-OVERCLOSURE=LINEAR"]
    lines += [f"{stiffness * SOFT}", "*FRICTION", f"{FRICTION},{stiffness * SOFT / 10}"]
    lines += ["*CONTACT PAIR, INTERACTION=TOUCH, TYPE=SURFACE TO SURFACE", "SLAVE,MASTER"]
    lines += ["*BOUNDARY", "ALL,3,3", "LOW,1,2"]
    for time, parts in ((1.0, 4), (1.5, 20)):
        across, down = place(time)
        lines += ["*STEP, NLGEOM, INC=2000", "*STATIC", f"{1 / parts},1.,1e-6,{1 / parts}", "*BOUNDARY"]
        lines += [f"TOP,1,1,{across}", f"TOP,2,2,{down}"]
        lines += ["*NODE PRINT, NSET=TOP, TOTALS=ONLY", "RF", "*END STEP"]
    return "\n".join([*lines, ""])


def by_calculix(
    comm: None, columns: int = COLUMNS, stiffness: float = 50.0, limit: float = 1700.0
) -> dict[str, Any]:
    """Return the record of CalculiX, face to face, with the way that it comes."""
    if (reason := missing()) is not None:
        return {"skipped": reason}
    try:
        run = solved(deck(columns, stiffness), limit)
    except subprocess.TimeoutExpired:
        return {"converged": False, "why": f"stopped after {limit:g} s"}
    rows = re.findall(r"and time\s+(\S+)\s*\n\s*\n\s*(\S+)\s+(\S+)\s+(\S+)", run["written"])
    at = np.array([[float(word) for word in row[:3]] for row in rows]).reshape(-1, 3)
    at[:, 0] = np.where(at[:, 0] > 1.0, 1.0 + (at[:, 0] - 1.0) / 2, at[:, 0])  # a step takes a unit of time
    record = {key: run[key] for key in ("seconds", "program_memory", "steps", "converged")}
    found = [
        _at(time, *at[k, 1:]) for time in TIMES for k in np.flatnonzero(np.abs(at[:, 0] - time) < 1e-6)[:1]
    ]
    if not run["converged"]:
        last = at[-1, 0] if len(at) else 0.0
        record["why"] = f"it ends {max(0.0, 10 * (last - 1)):.1f} mm along"
    return {**record, "times": found}
