"""A scene of the comparison by CalculiX, where its program ``ccx`` is installed.

A rigid plane is one held element below the block. Contact is soft, as in most decks: a pressure of
`stiffness` times Young's modulus a length of closure.
"""

from __future__ import annotations

import re
import resource
import shutil
import subprocess
import tempfile
from collections.abc import Iterable
from pathlib import Path
from typing import Any

import numpy as np

from benchmarks.cases.scene_data import PLANE_HEIGHT
from benchmarks.peers.evaluation import Whole, evaluated
from benchmarks.peers.scenes import SCENES, PeerScene
from fenics_contact import clean_environment

#: Type of the contact pair by how it is called here.
PAIRS = {"face": "SURFACE TO SURFACE", "node": "NODE TO SURFACE"}
#: Corners of the element that is the plane, below and around the block.
PLATE = np.array(
    [
        [x, y, PLANE_HEIGHT - z]
        for z in (0.1, 0.0)
        for x, y in ((-0.5, -0.5), (2.5, -0.5), (2.5, 1.5), (-0.5, 1.5))
    ]
)
PROGRAM = "ccx"


def missing() -> str | None:
    """Return why CalculiX cannot be used, or None."""
    found = shutil.which(PROGRAM) is not None
    return None if found else f"no program {PROGRAM} is found; on Debian: apt-get install calculix-ccx"


def _rows(lines: Iterable[Iterable[Any]]) -> list[str]:
    return [",".join(map(str, line)) for line in lines]


def mesh_cards(points: np.ndarray, cells: np.ndarray) -> list[str]:
    """Return the cards of nodes and hexahedra, numbered from 1."""
    nodes = _rows((k, *(f"{x:.15g}" for x in point)) for k, point in enumerate(points, 1))
    elements = _rows((k, *(cell + 1)) for k, cell in enumerate(cells, 1))
    return ["*NODE, NSET=ALL", *nodes, "*ELEMENT, TYPE=C3D8, ELSET=SOLID", *elements]


def contact_cards(scene: PeerScene, kind: str, stiffness: float) -> list[str]:
    """Return the cards of the surfaces' behaviour and their pair."""
    normal = stiffness * scene.young
    behaviour = f"{normal:g}" + (f",{1e-4 * scene.young:g}" if kind == "node" else "")
    friction = ["*FRICTION", f"{scene.friction},{normal / 10:g}"] if scene.friction else []
    return [
        "*SURFACE INTERACTION, NAME=TOUCH",
        "*SURFACE BEHAVIOR, PRESSURE-OVERCLOSURE=LINEAR",
        behaviour,
        *friction,
        f"*CONTACT PAIR, INTERACTION=TOUCH, TYPE={PAIRS[kind]}",
        "SLAVE,MASTER",
    ]


def deck(whole: Whole, kind: str, stiffness: float) -> str:
    """Return the deck of a scene."""
    scene, points, cells = whole.scene, whole.points, whole.cells
    held, sides = whole.held(), {"SLAVE": whole.faces(scene.slave)}
    if scene.master is None:
        plate = len(points) + np.arange(8)
        points, cells = np.concatenate([points, PLATE]), np.concatenate([cells, plate[None]])
        sides["MASTER"] = np.array([[len(cells) - 1, 1]])
        held |= {(int(node), d): 0.0 for node in plate for d in range(3)}
    else:
        sides["MASTER"] = whole.faces(scene.master)
    lines = mesh_cards(points, cells)
    for name, faces in sides.items():
        lines += [f"*SURFACE, NAME={name}, TYPE=ELEMENT", *_rows((c + 1, f"S{f + 1}") for c, f in faces)]
    lines += ["*MATERIAL, NAME=M", "*ELASTIC", f"{scene.young},{scene.poisson}"]
    lines += ["*SOLID SECTION, ELSET=SOLID, MATERIAL=M", *contact_cards(scene, kind, stiffness)]
    lines += ["*BOUNDARY", *_rows((a + 1, d + 1, d + 1) for (a, d), value in held.items() if value == 0.0)]
    lines += ["*STEP, INC=200", "*STATIC"]
    moved = _rows((a + 1, d + 1, d + 1, value) for (a, d), value in held.items() if value != 0.0)
    loads = [(a + 1, d + 1, f"{f:.12g}") for (a, d), f in np.ndenumerate(whole.loads()) if f != 0.0]
    lines += ["*BOUNDARY", *moved] if moved else []
    lines += ["*CLOAD", *_rows(loads)] if loads else []
    return "\n".join([*lines, "*NODE PRINT, NSET=ALL", "U", "*END STEP", ""])


def solved(text: str, limit: float) -> dict[str, Any]:
    """Run a deck; return what the program printed, its tables, processor seconds and memory.

    Its own words say whether it has converged: the exit status is zero after some errors, too.
    """
    with tempfile.TemporaryDirectory() as folder:
        job = Path(folder) / "job"
        job.with_suffix(".inp").write_text(text)
        before = resource.getrusage(resource.RUSAGE_CHILDREN)
        done = subprocess.run(
            [PROGRAM, "-i", str(job)],
            cwd=folder,
            env=clean_environment(),
            capture_output=True,
            text=True,
            timeout=limit,
            check=False,
        )
        used = resource.getrusage(resource.RUSAGE_CHILDREN)
        tables = job.with_suffix(".dat")
        written = tables.read_text() if tables.exists() else ""
    return {
        "printed": done.stdout,
        "written": written,
        "seconds": used.ru_utime + used.ru_stime - before.ru_utime - before.ru_stime,
        "program_memory": 1024 * used.ru_maxrss,
        "steps": len(re.findall(r"^ iteration \d+", done.stdout, re.MULTILINE)),
        "converged": "Job finished" in done.stdout and "*ERROR" not in done.stdout,
    }


def last_displacement(written: str, n_nodes: int) -> np.ndarray | None:
    """Return the displacement of the first nodes in the last table of a ``.dat`` file, shape (n, 3)."""
    tables = re.split(r"^ displacements.*$", written, flags=re.MULTILINE)[1:]
    if not tables:
        return None
    found = np.zeros((n_nodes, 3))
    for words in map(str.split, tables[-1].splitlines()):
        if len(words) == 4 and int(words[0]) <= n_nodes:
            found[int(words[0]) - 1] = [float(word) for word in words[1:]]
    return found


def measure(
    comm: None, scene: str, kind: str = "face", stiffness: float = 50.0, limit: float = 1700.0
) -> dict[str, Any]:
    """Return the record of a scene; processor seconds of the whole program, which has nothing to import."""
    if (reason := missing()) is not None:
        return {"skipped": reason}
    whole = Whole(SCENES[scene]())
    try:
        run = solved(deck(whole, kind, stiffness), limit)
    except subprocess.TimeoutExpired:
        return {"converged": False, "why": f"stopped after {limit:g} s"}
    record = {key: run[key] for key in ("seconds", "program_memory", "steps", "converged")}
    if not run["converged"]:
        errors = re.findall(r"\*ERROR[: ]*(.*)", run["printed"])
        return {**record, "why": errors[-1].strip() if errors else "it ended without an answer"}
    displacement = last_displacement(run["written"], len(whole.points))
    assert displacement is not None, "a job that has finished writes displacements"
    return {**record, **evaluated(whole, displacement)}
