"""Run by FreeCAD's Python: solves examples and writes what FreeCAD has loaded of the results.

Arguments are in the environment: EXAMPLES, CCX and GMSH, the programs, PAGE of the
guide, and FOLDER.
"""

from __future__ import annotations

import json
import os
from importlib import import_module
from pathlib import Path
from typing import Any

import FreeCAD  # type: ignore[import-not-found]

FOLDER = Path(os.environ["FOLDER"])


def use(kind: str, name: str, path: str) -> None:
    """Set the path to a program in FreeCAD's preferences."""
    settings = FreeCAD.ParamGet(f"User parameter:BaseApp/Preferences/Mod/Fem/{kind}")
    settings.SetBool(f"UseStandard{kind}Location", False)
    settings.SetString(name, path)


def made(name: str) -> Any:
    """Return the document of an example: one of FreeCAD's, or the first one of the guide's page."""
    if name != "coincident":
        doc = FreeCAD.newDocument(name)
        import_module(f"femexamples.{name}").setup(doc, "ccxtools")
        doc.recompute()
        return doc
    page = Path(os.environ["PAGE"]).read_text()
    exec(page.partition("```python\n")[2].partition("```")[0], {})
    return FreeCAD.ActiveDocument


def solve(name: str) -> None:
    """Solve an example by the program that the preferences name, and load its results."""
    doc = made(name)
    (solver,) = [each for each in doc.Objects if each.isDerivedFrom("Fem::FemSolverObjectPython")]
    (analysis,) = [each for each in doc.Objects if each.TypeId == "Fem::FemAnalysis"]
    run = import_module("femtools.ccxtools").FemToolsCcx(analysis, solver)
    run.update_objects()
    (FOLDER / name).mkdir()
    run.setup_working_dir(str(FOLDER / name))
    run.setup_ccx()
    found = {"prerequisites": run.check_prerequisites(), "version": run.get_ccx_version()}
    run.write_inp_file()
    found |= {"code": run.ccx_run(), "out": run.ccx_stdout, "err": run.ccx_stderr}
    if not found["code"]:
        run.purge_results()
        run.load_results()
        loaded = [each for each in doc.Objects if each.isDerivedFrom("Fem::FemResultObject")][-1]
        found["nodes"] = list(loaded.NodeNumbers)
        found["displacement"] = [list(each) for each in loaded.DisplacementVectors]
        found["von_mises"] = list(loaded.vonMises)
    (FOLDER / f"{name}.json").write_text(json.dumps(found))
    FreeCAD.closeDocument(name)


use("Ccx", "ccxBinaryPath", os.environ["CCX"])
use("Gmsh", "gmshBinaryPath", os.environ["GMSH"])
for example in os.environ["EXAMPLES"].split():
    solve(example)
