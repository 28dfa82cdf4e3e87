"""Mistakes in a scene file, one at a time, with what the package says; prints the page about them.

python -m tests.scene_file.mistakes > docs/scene_file_mistakes.md
"""

from __future__ import annotations

import sys
from pathlib import Path

from mpi4py import MPI

from fenics_contact import read_scene_file
from fenics_contact._base.progress import visible
from fenics_contact._scene_file.source import SceneFileError
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
        "keys of materials.steel are model, young_modulus, poisson_ratio, thermal_expansion, thickness",
    ),
    "a table is misspelt": (
        "[[contacts]]",
        "[[contact]]",
        "scene.toml, line 37: contact is not known: did you mean 'contacts'? the keys of the file are title, "
        "units, meshes, materials, bodies, supports, loads, contacts, automatic_contact, ties, "
        "preloads, foundations, springs, constraints, steps, solver, accuracy, output, design, heat",
    ),
    "a key is missing": (
        "poisson_ratio = 0.3\n",
        "",
        "scene.toml, line 15: materials.steel must have 'poisson_ratio', got only young_modulus: Poisson's "
        "ratio ν in (−1, 0.5), dimensionless",
    ),
    "a number is out of range": (
        "poisson_ratio = 0.3",
        "poisson_ratio = 0.5",
        "scene.toml, line 17: materials.steel.poisson_ratio must be a number less than 0.5, got 0.5: "
        "Poisson's ratio ν in (−1, 0.5), dimensionless",
    ),
    "a number is text": (
        "poisson_ratio = 0.3",
        'poisson_ratio = "0.3"',
        'scene.toml, line 17: materials.steel.poisson_ratio must be a number, got "0.3": Poisson\'s ratio ν '
        "in (−1, 0.5), dimensionless",
    ),
    "a vector is too short": (
        "counts = [2, 2, 1]",
        "counts = [2, 2]",
        "scene.toml, line 7: meshes.lower.counts must be three integers from 1 to 1000000 in brackets, got "
        "[2, 2]: number of hexahedra along x, y and z",
    ),
    "a shape is not known": (
        'shape = "block"',
        'shape = "blok"',
        "scene.toml, line 4: meshes.lower.shape must be one of 'block', 'rectangle', 'hemisphere', "
        "'half_cylinder', 'half_disc', 'disc', 'ball', 'cylinder', 'drilled_plate', 'bolt', 'chain_link', "
        "'two_links', 'chain', got "
        "\"blok\": did you mean 'block'?",
    ),
    "a law of friction is not known": (
        'law = "coulomb"',
        'law = "culomb"',
        "scene.toml, line 40: contacts.0.friction.law must be one of 'none', 'coulomb', 'tresca', got "
        "\"culomb\": did you mean 'coulomb'?",
    ),
    "an objective is not known": (
        "[solver]",
        '[design]\nobjective = "largest_presure"\nsurfaces = [{ body = "upper", lower = -1, upper = 1 }]\n\n'
        "[solver]",
        "scene.toml, line 43: design.objective must be one of 'total_potential', 'strain_energy', "
        "'largest_pressure', 'pressure_norm', 'pressure_unevenness', 'contact_area', 'friction_work', got "
        "\"largest_presure\": did you mean 'largest_pressure'? (what is minimised: a name, a table with its "
        'kind and arguments, a list of tables, which are added, or "file.py:NAME", an Objective)',
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
        "scene.toml, line 37: contacts.0: contact of body 'upper' with itself needs a material for large "
        "deformations, such as NeoHooke, discretisation='node' and gaps as they are: give these, or split "
        "the body",
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
        "scene.toml, line 31: loads.0 must have 'kind', one of 'traction', 'total_force', 'total_moment', "
        "'pressure', 'body_force', 'point_force', 'gravity', 'centrifugal', 'point_mass', 'thermal', "
        "'initial_stress', got only body, surface, value",
    ),
    "a formula is no arithmetic": (
        "value = [10.0, 0.0, -100.0]",
        'value = ["open(x)", 0.0, -100.0]',
        "scene.toml, line 35: loads.0.value: a formula may hold numbers, x, y, z, t, pi, e, + - * / **, "
        "comparisons with < <= > >=, and abs, acos, asin, atan, atan2, cos, cosh, exp, log, max, min, sign, "
        "sin, sinh, sqrt, tan, tanh, where, got 'open(x)' in 'open(x)': leave it out",
    ),
    "a sum is fine, brackets are too many": (
        "value = [10.0, 0.0, -100.0]",
        f'value = ["{"abs(" * 60}x{")" * 60}", "{" + ".join(["x"] * 60)}", -100.0]',
        "scene.toml, line 35: loads.0.value: a formula may hold numbers, x, y, z, t, pi, e, + - * / **, "
        "comparisons with < <= > >=, and abs, acos, asin, atan, atan2, cos, cosh, exp, log, max, min, "
        "sign, sin, sinh, sqrt, tan, tanh, where, got 'more than 50 nested operations' in "
        "'abs(abs(abs(abs(abs(abs(abs(abs(abs(abs(abs(abs(abs(abs(a...': leave it out",
    ),
    "a formula has no value": (
        "value = [10.0, 0.0, -100.0]",
        'value = ["1/0", 0.0, -100.0]',
        "scene.toml, line 35: loads.0.value: the formula '1/0' must have a finite value at every node, "
        "got inf at (0.5, 0.5, 2): choose another one there with where(condition, a, b)",
    ),
    "a number has four hundred digits": (
        "2.1e5",
        "1" + "0" * 400,
        "scene.toml, line 16: materials.steel.young_modulus must be a number below 1.8e308, the largest "
        "that there is, got 100000000000000000000000000000000000000000000000000000000...: Young's modulus"
        " E > 0, [force / length²]",
    ),
    "a vector has four hundred digits": (
        "value = [10.0,",
        f"value = [1{'0' * 400},",
        "scene.toml, line 35: loads.0.value must be three numbers or formulas in brackets, for x, y "
        "and z (two for a plane body), or a table {file = ..., field = ...}, got "
        "[10000000000000000000000000000000000000000000000000000000...: force per reference area, "
        "[force / length²] (in the plane: per unit of thickness); numbers, formulas in x, y, z in quotes, or "
        "fields from files",
    ),
    "a count has four hundred digits": (
        "counts = [2, 2, 1]",
        f"counts = [1{'0' * 400}, 2, 1]",
        "scene.toml, line 7: meshes.lower.counts must be three integers from 1 to 1000000 in brackets, "
        "got [10000000000000000000000000000000000000000000000000000000...: number of hexahedra along x, "
        "y and z",
    ),
    "cells are too many in a row": (
        "counts = [2, 2, 1]",
        "counts = [1_000_000_000, 2, 1]",
        "scene.toml, line 7: meshes.lower.counts must be three integers from 1 to 1000000 in brackets, "
        "got [1000000000, 2, 1]: number of hexahedra along x, y and z",
    ),
    "load steps are too many": (
        "[solver]",
        "[[steps]]\ncount = 1_000_000_000\n\n[solver]",
        "scene.toml, line 43: steps.0.count must be a number of at most 100000, got 1000000000: number of"
        " load steps in which the values are reached",
    ),
    "a name changes colours": (
        'title = "Two blocks"',
        'title = "\\u001b[31mTwo blocks"',
        'scene.toml, line 1: title must be text that can be shown, got "\\u001b[31mTwo blocks": leave out '
        "control characters",
    ),
    "a key holds a zero byte": (
        'title = "Two blocks"',
        '"\\u0000" = "Two blocks"',
        'scene.toml, line 1: "\\x00" must be text that can be shown, got "\\u0000": leave out control '
        "characters",
    ),
    "a path is longer than any can be": (
        "[solver]",
        f'[output]\nfolder = "{"a" * 300}"\n\n[solver]',
        "scene.toml, line 43: output.folder must be a path of at most 4000 bytes in which no name has "
        'more than 255 bytes, got "aaaaaaaaaaaaaaaaaaaaaaaaaaaaaaaaaaaaaaaaaaaaaaaaaaaaaaaa...: folder of'
        " the results, relative to where the command runs (output/NAME of the file)",
    ),
    "a byte-order mark comes first": (
        'title = "Two blocks"',
        '\ufefftitle = "Two blocks"',
        "scene.toml, line 1: must be TOML in UTF-8, which has no byte-order mark, got one before the "
        "first character: let the editor save the file as UTF-8 without BOM",
    ),
    "a key is there twice": (
        "poisson_ratio = 0.3",
        "poisson_ratio = 0.3\npoisson_ratio = 0.3",
        "scene.toml, line 18: must be TOML, got 'poisson_ratio = 0.3': Cannot overwrite a value",
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
        _ = read_scene_file(path, comm).steps  # builds the scene first
    except SceneFileError as error:
        return str(error)
    return ""


def _shown(text: str) -> str:
    """Return a piece of a file in one line, what is long or invisible in words."""
    line = visible(" ".join(text.replace("\ufeff", "(mark)").split()))
    return f"`{line if len(line) <= 70 else f'{line[:40]}...{line[-20:]}'}`" if line else ""


def page(folder: Path) -> str:
    """Return the page with all mistakes."""
    parts = [PAGE]
    for name, (old, new, _) in MISTAKES.items():
        message = said(changed((old, new)), folder, MPI.COMM_SELF)
        wanted = _shown(old)
        given = _shown(new) or "nothing"
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
