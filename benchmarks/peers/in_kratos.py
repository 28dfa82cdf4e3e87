"""A scene of the comparison by Kratos, where its distributions of pip are installed.

Mortar contact with augmented Lagrangian multipliers of its ContactStructuralMechanicsApplication, in its own
defaults; a rigid plane is one held element below the block.
"""

from __future__ import annotations

import json
import tempfile
from collections.abc import Iterable
from pathlib import Path
from time import process_time
from typing import Any

import numpy as np

from benchmarks.peers.calculix import PLATE
from benchmarks.peers.evaluation import Whole, evaluated, taken
from benchmarks.peers.scenes import SCENES

STEPS = 30
#: Faces of the plane's element: that which is touched comes first.
PLATE_FACES = np.array([[4, 5, 6, 7], [0, 1, 2, 3]])


def missing() -> str | None:
    """Return why Kratos cannot be used, or None."""
    try:
        import KratosMultiphysics.ContactStructuralMechanicsApplication
        import KratosMultiphysics.StructuralMechanicsApplication  # noqa: F401
    except ImportError as error:
        return f"Kratos cannot be imported ({error}); pip install KratosContactStructuralMechanicsApplication"
    return None


def _block(kind: str, lines: Iterable[Iterable[Any]]) -> list[str]:
    """Return a block of Kratos' mesh file."""
    return [f"Begin {kind}", *(" ".join(map(str, line)) for line in lines), f"End {kind.split()[0]}"]


def _part(name: str, nodes: Iterable[int], elements: Iterable[int], conditions: Iterable[int]) -> list[str]:
    lists = (("Nodes", nodes), ("Elements", elements), ("Conditions", conditions))
    lines = (line for kind, each in lists for line in _block(f"SubModelPart{kind}", ([k] for k in each)))
    return [f"Begin SubModelPart {name}", *lines, "End SubModelPart"]


def mesh_file(whole: Whole) -> tuple[str, int]:
    """Return the text of the mesh with its parts, and the number of supports."""
    scene, points, cells = whole.scene, whole.points, whole.cells
    supports = [whole.nodes(side) for side, _ in scene.held]
    sides = {"slave": whole.facets(scene.slave)}
    if scene.master is None:
        sides["master"] = len(points) + PLATE_FACES[:1]
        supports.append(len(points) + np.arange(8))
        cells = np.concatenate([cells, len(points) + np.arange(8)[None]])
        points = np.concatenate([points, PLATE])
    else:
        sides["master"] = whole.facets(scene.master)
    kinds = dict.fromkeys(sides, "SurfaceCondition3D4N")
    if scene.traction is not None:
        sides["loaded"], kinds["loaded"] = whole.facets(scene.traction[0]), "SurfaceLoadCondition3D4N"
    lines = ["Begin Properties 1", "End Properties"]
    lines += _block("Nodes", ((k, *(f"{x:.15g}" for x in point)) for k, point in enumerate(points, 1)))
    lines += _block(
        "Elements SmallDisplacementElement3D8N", ((k, 1, *(cell + 1)) for k, cell in enumerate(cells, 1))
    )
    numbers, first = {}, 1
    for name, facets in sides.items():
        numbers[name] = range(first, first + len(facets))
        rows = zip(numbers[name], facets, strict=True)
        lines += _block(f"Conditions {kinds[name]}", ((k, 1, *(facet + 1)) for k, facet in rows))
        first += len(facets)
    lines += _part("Parts", range(1, len(points) + 1), range(1, len(cells) + 1), ())
    for number, held in enumerate(supports):
        lines += _part(f"Held{number}", held + 1, (), ())
    nodes = {name: np.unique(facets) + 1 for name, facets in sides.items()}
    if "loaded" in sides:
        lines += _part("Loaded", nodes["loaded"], (), numbers["loaded"])
    both = np.union1d(nodes["slave"], nodes["master"])
    lines += _part("Touching", both, (), [*numbers["slave"], *numbers["master"]])
    lines += _part("Slave", nodes["slave"], (), numbers["slave"])
    return "\n".join([*lines, ""]), len(supports)


def _process(module: str, kratos: str, **parameters: Any) -> dict[str, Any]:
    return {"python_module": module, "kratos_module": kratos, "Parameters": parameters}


def settings(whole: Whole, mesh: Path, n_supports: int) -> dict[str, Any]:
    """Return the parameters of the analysis."""
    scene = whole.scene
    kind = "Frictional" if scene.friction else "Frictionless"
    values = [value for _, value in scene.held] + [(0.0, 0.0, 0.0)] * (n_supports - len(scene.held))
    supports = [
        _process(
            "assign_vector_variable_process", "KratosMultiphysics", model_part_name=f"Structure.Held{k}",
            variable_name="DISPLACEMENT", constrained=[x is not None for x in value], value=list(value),
            interval=[0.0, "End"],
        )
        for k, value in enumerate(values)
    ]  # fmt: skip
    loads = []
    if scene.traction is not None:
        size = float(np.linalg.norm(scene.traction[1]))
        loads = [
            _process(
                "assign_vector_by_direction_to_condition_process", "KratosMultiphysics",
                model_part_name="Structure.Loaded", variable_name="SURFACE_LOAD", interval=[0.0, "End"],
                modulus=size, direction=[value / size for value in scene.traction[1]],
            )
        ]  # fmt: skip
    contact = _process(
        "alm_contact_process", "KratosMultiphysics.ContactStructuralMechanicsApplication",
        model_part_name="Structure", contact_model_part={"0": ["Touching"]},
        assume_master_slave={"0": ["Slave"]}, contact_type=kind, friction_coefficients={"0": scene.friction},
    )  # fmt: skip
    return {
        "problem_data": {
            "problem_name": "scene", "parallel_type": "OpenMP", "start_time": 0.0, "end_time": 1.0 - 1e-9,
            "echo_level": 0,
        },
        "solver_settings": {
            "solver_type": "Static", "model_part_name": "Structure", "domain_size": 3, "echo_level": 0,
            "analysis_type": "non_linear", "max_iteration": STEPS, "compute_reactions": True,
            "model_import_settings": {"input_type": "mdpa", "input_filename": str(mesh)},
            "material_import_settings": {"materials_filename": f"{mesh}.json"},
            "time_stepping": {"time_step": 1.0}, "clear_storage": True, "reform_dofs_at_each_step": True,
            "contact_settings": {"mortar_type": f"ALMContact{kind}"},
            "convergence_criterion": "contact_residual_criterion",
        },
        "processes": {
            "constraints_process_list": supports,
            "loads_process_list": loads,
            "contact_process_list": [{**contact, "process_name": "ALMContactProcess"}],
        },
    }  # fmt: skip


def material(whole: Whole) -> dict[str, Any]:
    """Return the file of the one material."""
    scene = whole.scene
    constants = {"DENSITY": 1.0, "YOUNG_MODULUS": scene.young, "POISSON_RATIO": scene.poisson}
    law = {"name": "M", "constitutive_law": {"name": "LinearElastic3DLaw"}, "Tables": {}}
    law["Variables"] = {**constants, "FRICTION_COEFFICIENT": scene.friction}
    return {"properties": [{"model_part_name": "Structure.Parts", "properties_id": 1, "Material": law}]}


def measure(comm: None, scene: str) -> dict[str, Any]:
    """Return the record of a scene; processor seconds from the meshes to the state."""
    if (reason := missing()) is not None:
        return {"skipped": reason}
    import KratosMultiphysics as Kratos
    from KratosMultiphysics.StructuralMechanicsApplication import structural_mechanics_analysis

    start, whole = process_time(), Whole(SCENES[scene]())
    with tempfile.TemporaryDirectory() as folder:
        mesh = Path(folder) / "scene"
        text, n_supports = mesh_file(whole)
        mesh.with_suffix(".mdpa").write_text(text)
        Path(f"{mesh}.json").write_text(json.dumps(material(whole)))
        model = Kratos.Model()
        analysis = structural_mechanics_analysis.StructuralMechanicsAnalysis(
            model, Kratos.Parameters(json.dumps(settings(whole, mesh, n_supports)))
        )
        analysis.Initialize()
        solver = analysis._GetSolver()
        analysis.time = analysis._AdvanceTime()
        analysis.InitializeSolutionStep()
        solver.Predict()
        converged = bool(solver.SolveSolutionStep())
        analysis.FinalizeSolutionStep()
    steps = int(solver.GetComputingModelPart().ProcessInfo[Kratos.NL_ITERATION_NUMBER])
    record = taken(start, steps, converged)
    nodes = [node for node in model["Structure"].Nodes if node.Id <= len(whole.points)]
    displacement = np.zeros_like(whole.points)
    displacement[[node.Id - 1 for node in nodes]] = [
        list(node.GetSolutionStepValue(Kratos.DISPLACEMENT)) for node in nodes
    ]
    return {**record, **evaluated(whole, displacement)} if converged else record
