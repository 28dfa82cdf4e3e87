"""Files of an optimised surface for other programs, as a scene file asks for them."""

from __future__ import annotations

from pathlib import Path

import numpy as np

from fenics_contact.cli.desk import Console
from fenics_contact.errors import InvalidInputError
from fenics_contact.io import CadError, file_of_each, write_design_table, write_step, write_stl
from fenics_contact.scene_file import SceneFile
from fenics_contact.shape import LoadPath, ShapeProblem

_MILLIMETRES = {"µm": 1e-3, "um": 1e-3, "mm": 1.0, "cm": 10.0, "m": 1000.0, "in": 25.4}


def check_design_files(file: SceneFile) -> None:
    """Refuse kinds of files that the scene cannot have, before anything is solved.

    Raises:
        InvalidInputError: If the scene is plane and STL is asked for, or STEP in an unknown unit.
    """
    kinds, length = file.document.output.design, file.document.units.length
    if "stl" in kinds and file.scene.dim == 2:
        raise InvalidInputError('output.design must be "csv" or "step" for a plane scene, got "stl"')
    if "step" in kinds and length not in _MILLIMETRES:
        raise InvalidInputError(
            f'output.design "step" needs a unit of length that is known in millimetres, got {length!r}: name '
            f"one of {', '.join(_MILLIMETRES)} in [units]"
        )


def write_design_files(
    console: Console, file: SceneFile, problem: ShapeProblem | LoadPath, alpha: np.ndarray
) -> list[Path]:
    """Write the files of a design that the scene file asks for, and return them. Collective."""
    kinds, length, folder = file.document.output.design, file.document.units.length, file.folder
    bodies = sorted({design.body for design in problem.designs})
    written = []
    if "csv" in kinds:
        for number in range(len(problem.designs)):
            path = folder / ("design.csv" if number == 0 else f"design_{number + 1}.csv")
            written.append(write_design_table(problem, alpha, path, design=number, length=length))
    if "stl" in kinds:
        for body, path in file_of_each(bodies, folder, "design", ".stl").items():
            written.append(write_stl(problem, alpha, path, body=body))
    if "step" in kinds:
        for body, path in file_of_each(bodies, folder, "design", ".step").items():
            _write_step(console, problem, alpha, path, body, _MILLIMETRES[length])
            written.append(path)
    return written


def _write_step(
    console: Console, problem: ShapeProblem | LoadPath, alpha: np.ndarray, path: Path, body: str, scale: float
) -> None:
    """Write a body, or what can be written of it. Collective."""
    try:
        write_step(problem, alpha, path, body=body, scale=scale)
    except CadError as error:
        console.say(f"{path.name} has the designed surface alone: {error}")
        write_step(problem, alpha, path, body=body, scale=scale, solid=False)
