"""Mistakes in a scene file, one at a time, with what the package says; prints the page about them.

python -m tests.scene_file.mistakes > docs/scene_file_mistakes.md
"""

from __future__ import annotations

import sys
from pathlib import Path

from mpi4py import MPI

from fenics_contact.scene_file import SceneFileError, read_scene_file
from tests.scene_file.texts import GOOD, changed

#: What is wrong -> (what the file should have, what it has, what is said).
MISTAKES: dict[str, tuple[str, str, str]] = {
    "a bracket is not closed": (
        "lower = [0.0, 0.0, 0.0]",
        "lower = [0.0, 0.0, 0.0",
        "scene.toml, line 6: must be TOML, got 'upper = [2.0, 2.0, 1.0]': Unexpected character: 'u'; a "
        "bracket or quote may be open on a line before",
    ),
    "a key is misspelt": (
        "young_modulus = 2.1e5",
        "youngs_modulus = 2.1e5",
        "scene.toml, line 16: materials.steel.youngs_modulus is not known: did you mean 'young_modulus'? the "
        "keys of materials.steel are model, young_modulus, poisson_ratio, thermal_expansion",
    ),
    "a table is misspelt": (
        "[[contacts]]",
        "[[contact]]",
        "scene.toml, line 37: contact is not known: did you mean 'contacts'? the keys of the file are title, "
        "units, meshes, materials, bodies, supports, loads, contacts, ties, steps, solver, output, design",
    ),
    "a key is missing": (
        "poisson_ratio = 0.3\n",
        "",
        "scene.toml, line 15: materials.steel must have 'poisson_ratio', got only young_modulus: Poisson's "
        "ratio ν, between -1 and 0.5, dimensionless",
    ),
    "a number is out of range": (
        "poisson_ratio = 0.3",
        "poisson_ratio = 0.5",
        "scene.toml, line 17: materials.steel.poisson_ratio must be a number less than 0.5, got 0.5: "
        "Poisson's ratio ν, between -1 and 0.5, dimensionless",
    ),
    "a number is text": (
        "coefficient = 0.3",
        'coefficient = "0.3"',
        'scene.toml, line 40: contacts.0.friction.coefficient must be a number, got "0.3": friction '
        "coefficient μ, dimensionless",
    ),
    "a vector is too short": (
        "counts = [2, 2, 1]",
        "counts = [2, 2]",
        "scene.toml, line 7: meshes.lower.counts must be three positive integers in brackets, got [2, 2]: "
        "cells along x, y and z",
    ),
    "a shape is not known": (
        'shape = "block"',
        'shape = "blok"',
        "scene.toml, line 4: meshes.lower.shape must be one of 'block', 'rectangle', 'hemisphere', "
        "'half_cylinder', 'half_disc', 'drilled_plate', 'bolt', 'chain_link', 'two_links', 'chain', got "
        "\"blok\": did you mean 'block'?",
    ),
    "a law of friction is not known": (
        'law = "coulomb"',
        'law = "culomb"',
        "scene.toml, line 40: contacts.0.friction.law must be one of 'none', 'coulomb', 'tresca', got "
        "\"culomb\": did you mean 'coulomb'?",
    ),
    "a material is not there": (
        'material = "steel"',
        'material = "steal"',
        "scene.toml, line 21: bodies.lower.material must be a material, one of 'steel', got \"steal\": did "
        "you mean 'steel'?",
    ),
    "a body is not there": (
        'master = { body = "lower"',
        'master = { body = "lowr"',
        "scene.toml, line 39: contacts.0.master.body must be a body, one of 'lower', 'upper', got \"lowr\": "
        "did you mean 'lower'?",
    ),
    "a surface is not there": (
        'surface = "z0"',
        'surface = "bottom"',
        "scene.toml, line 29: supports.0.surface must be a surface of the body 'lower', one of 'x0', 'x1', "
        "'y0', 'y1', 'z0', 'z1', got \"bottom\"",
    ),
    "corners are swapped": (
        "upper = [2.0, 2.0, 1.0]",
        "upper = [2.0, 2.0, -1.0]",
        "scene.toml, line 3: meshes.lower: upper must exceed lower in x, y and z, got lower [0.0, 0.0, 0.0] "
        "and upper [2.0, 2.0, -1.0]: swap or correct the corners",
    ),
    "a body touches itself": (
        'master = { body = "lower", surface = "z1" }',
        'master = { body = "upper", surface = "z1" }',
        "scene.toml, line 37: contacts.0: contact of body 'upper' with itself is not supported: slave and "
        "master must belong to different bodies; split the body if its parts may touch",
    ),
    "a tolerance is no tolerance": (
        "tolerance = 1e-8",
        "tolerance = 10",
        'scene.toml, line 43: solver.tolerance must be a number between 0 and 1, or "balanced", got 10: '
        "largest relative residual, or balanced: as accurate as the mesh deserves",
    ),
    "a load has no kind": (
        'kind = "traction"\n',
        "",
        "scene.toml, line 31: loads.0 must have 'kind', one of 'traction', 'total_force', 'pressure', "
        "'body_force', 'gravity', 'thermal', got only body, surface, value",
    ),
    "a formula is no arithmetic": (
        "value = [10.0, 0.0, -100.0]",
        'value = ["open(x)", 0.0, -100.0]',
        "scene.toml, line 35: loads.0.value: a formula may hold numbers, x, y, z, pi, e, + - * / **, "
        "comparisons with < <= > >=, and abs, acos, asin, atan, atan2, cos, cosh, exp, log, max, min, sign, "
        "sin, sinh, sqrt, tan, tanh, where, got 'open(x)' in 'open(x)': leave it out, or give the value by a "
        "scene in Python",
    ),
}

PAGE = """\
# Mistakes in scene files

Every mistake is reported with the file, the line, the key, what is allowed and what was given; several at
once are all listed. This page is made by `python -m tests.scene_file.mistakes`, which makes each of these
mistakes in one file and writes down what was said.

"""


def said(text: str, folder: Path, comm: MPI.Comm) -> str:
    """Return what is said about a scene file with this text, "" where nothing is wrong. Collective."""
    path = folder / "scene.toml"
    if comm.rank == 0:
        path.write_text(text, encoding="utf-8")
    comm.Barrier()
    try:
        _ = read_scene_file(path, comm).scene
    except SceneFileError as error:
        return str(error)
    return ""


def page(folder: Path) -> str:
    """Return the page with all mistakes."""
    parts = [PAGE]
    for name, (old, new, _) in MISTAKES.items():
        message = said(changed((old, new)), folder, MPI.COMM_SELF)
        wanted = f"`{old.strip()}`"
        given = f"`{new.strip()}`" if new.strip() else "nothing"
        parts.append(
            f"## {name.capitalize()}\n\nNeeded {wanted}, the file has {given}:\n\n```text\n{message}\n```\n\n"
        )
    both = changed(*((old, new) for old, new, _ in list(MISTAKES.values())[2:9:2]))
    parts.append(
        f"## Several at once\n\n```text\n{said(both, folder, MPI.COMM_SELF)}\n```\n\n"
        f"## The file\n\nwithout mistakes:\n\n```toml\n{GOOD}```\n"
    )
    return "".join(parts)


if __name__ == "__main__":
    import tempfile

    with tempfile.TemporaryDirectory() as folder:
        sys.stdout.write(page(Path(folder)))
