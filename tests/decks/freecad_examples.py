"""Run by FreeCAD's Python: solves examples and writes what FreeCAD has loaded of the results.

Arguments are in the environment: EXAMPLES, CCX and GMSH, the programs, and FOLDER.
"""

from __future__ import annotations

import json
import os
from importlib import import_module
from pathlib import Path
from typing import Any

import FreeCAD  # type: ignore[import-not-found]
import ObjectsFem  # type: ignore[import-not-found]

FOLDER = Path(os.environ["FOLDER"])


def use(kind: str, name: str, path: str) -> None:
    """Set the path to a program in FreeCAD's preferences."""
    settings = FreeCAD.ParamGet(f"User parameter:BaseApp/Preferences/Mod/Fem/{kind}")
    settings.SetBool(f"UseStandard{kind}Location", False)
    settings.SetString(name, path)


def coincident(doc: Any) -> None:
    """A small block on a large one, as a compound whose faces coincide."""
    lower, upper = doc.addObject("Part::Box", "Lower"), doc.addObject("Part::Box", "Upper")
    lower.Length, lower.Width, lower.Height = 20, 20, 10
    upper.Length, upper.Width, upper.Height = 10, 10, 10
    upper.Placement.Base = FreeCAD.Vector(5, 5, 10)
    both = doc.addObject("Part::Compound", "Both")
    both.Links = [lower, upper]
    doc.recompute()

    def face(z: float, area: float) -> tuple[Any, str]:
        for number, each in enumerate(both.Shape.Faces, start=1):
            if abs(each.CenterOfMass.z - z) < 1e-6 and abs(each.Area - area) < 1e-6:
                return both, f"Face{number}"
        raise LookupError(z)

    analysis = ObjectsFem.makeAnalysis(doc, "Analysis")
    solver = ObjectsFem.makeSolverCalculixCcxTools(doc)
    solver.AnalysisType, solver.GeometricalNonlinearity = "static", "linear"
    material = ObjectsFem.makeMaterialSolid(doc, "Steel")
    material.Material = {"Name": "Steel", "YoungsModulus": "210000 MPa", "PoissonRatio": "0.30"}
    fixed = ObjectsFem.makeConstraintFixed(doc, "Fixed")
    fixed.References = [face(0, 400)]
    guided = ObjectsFem.makeConstraintDisplacement(doc, "Guided")
    guided.References, guided.xFix, guided.yFix = [face(20, 100)], True, True
    guided.xFree = guided.yFree = False
    pressure = ObjectsFem.makeConstraintPressure(doc, "Pressure")
    pressure.References, pressure.Pressure = [face(20, 100)], 10.0
    contact = ObjectsFem.makeConstraintContact(doc, "Contact")
    contact.References, contact.Friction, contact.Slope = [face(10, 100), face(10, 400)], 0.0, 1e6
    mesh = ObjectsFem.makeMeshGmsh(doc, "Mesh")
    mesh.Part, mesh.CharacteristicLengthMax, mesh.CoherenceMesh = both, 5.0, False
    for each in (solver, material, fixed, guided, pressure, contact, mesh):
        analysis.addObject(each)
    doc.recompute()
    import_module("femmesh.gmshtools").GmshTools(mesh).create_mesh()


def solve(name: str) -> None:
    """Solve an example by the program that the preferences name, and load its results."""
    doc = FreeCAD.newDocument(name)
    coincident(doc) if name == "coincident" else import_module(f"femexamples.{name}").setup(doc, "ccxtools")
    doc.recompute()
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
