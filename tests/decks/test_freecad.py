"""FreeCAD's own examples, solved by the command that its preferences name, and the results that it loads."""

from __future__ import annotations

import json
import shutil
import subprocess
import sys
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from mpi4py import MPI

from fenics_contact import clean_environment
from fenics_contact.decks import read_deck
from tests.conftest import ROOT
from tests.frd_files import read_frd

FREECAD = shutil.which("freecadcmd")
EXAMPLES = (
    "ccx_cantilever_faceload", "ccx_cantilever_nodeload", "boxanalysis_static", "constraint_section_print",
    "material_multiple_tensionrod_twoboxes", "constraint_contact_solid_solid", "coincident",
)  # fmt: skip
#: Largest displacement, as FreeCAD shows CalculiX 2.20's.
THEIRS = {
    "ccx_cantilever_faceload": 87.306454, "ccx_cantilever_nodeload": 87.408677,
    "boxanalysis_static": 0.09373835, "constraint_section_print": 9.754006,
    "material_multiple_tensionrod_twoboxes": 0.18362762, "constraint_contact_solid_solid": 0.0236734,
}  # fmt: skip


def program(path: Path, code: str) -> str:
    """Write a program that runs Python code."""
    path.write_text(f"#!/bin/sh\nexec env PYTHONPATH={ROOT} {sys.executable} -c '{code}' \"$@\"\n")
    path.chmod(0o755)
    return str(path)


@pytest.fixture(scope="module")
def solved(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A folder with the examples, and what FreeCAD has loaded of each."""
    folder = tmp_path_factory.mktemp("freecad")
    ccx = program(folder / "ccx", "import sys; from fenics_contact.__main__ import ccx; sys.exit(ccx())")
    gmsh = program(folder / "gmsh", "import gmsh, sys; gmsh.initialize(); gmsh.open(sys.argv[-1])")
    given = {"CCX": ccx, "GMSH": gmsh, "FOLDER": str(folder), "EXAMPLES": " ".join(EXAMPLES)}
    given["PAGE"] = str(ROOT / "docs" / "guide" / "freecad.md")
    given |= {"HOME": str(folder), "QT_QPA_PLATFORM": "offscreen"}
    environment = {name: value for name, value in clean_environment().items() if name != "PYTHONPATH"}
    script = ROOT / "tests" / "decks" / "freecad_examples.py"
    done = subprocess.run(
        [str(FREECAD), str(script)],
        cwd=folder, env={**environment, **given}, capture_output=True, text=True, timeout=900,
    )  # fmt: skip
    (folder / "log").write_text(done.stdout + done.stderr)
    return folder


@pytest.mark.slow
@pytest.mark.skipif(FREECAD is None, reason="FreeCAD is not installed")
@pytest.mark.parametrize("name", EXAMPLES)
def test_freecad_loads_what_was_computed(name: str, solved: Path) -> None:
    result = solved / f"{name}.json"
    assert result.exists(), (solved / "log").read_text()[-3000:]
    found: dict[str, Any] = json.loads(result.read_text())
    assert (found["code"], found["prerequisites"], found["version"]) == (0, "", [2, 20]), found["out"]
    assert found["err"] == ""
    (deck,) = (solved / name).glob("*.inp")
    loaded = dict(zip(found["nodes"], found["displacement"], strict=True))
    written = read_frd(deck.with_suffix(".frd"))
    values = written.block("DISP").at(list(loaded))
    size = np.abs(values).max()
    assert np.abs(np.array(list(loaded.values())) - values).max() <= 1e-9 * size
    read = read_deck(deck)
    (state,) = read.solve(MPI.COMM_SELF)
    for body, numbers in read.node_numbers.items():
        mine = numbers > 0
        ours = state.gather_displacement(body)[mine]
        theirs = np.array([loaded[number] for number in numbers[mine].tolist()])
        assert np.abs(ours - theirs).max() <= 6e-6 * size  # printed with six digits
    assert max(found["von_mises"]) > 0.0
    if name in THEIRS:
        largest = np.linalg.norm(values, axis=1).max()
        assert largest == pytest.approx(THEIRS[name], rel=1e-3 if "contact" in name else 5e-6)
    else:
        assert any("which coincide: read as" in words for words in read.notes)
        assert state.contact.normal_force.sum() == pytest.approx(1000.0, rel=1e-3)
