"""Files that are spoilt, each with the scene file or deck by which the command line reads it."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from pathlib import Path

import numpy as np

from fenics_contact.gallery import block, rectangle
from fenics_contact.readers.gmsh_session import silenced
from tests.decks import columns
from tests.decks import texts as parts
from tests.readers.mesh_files import joined, with_tags

ROOT = Path(__file__).parents[2]

_BLOCKS = parts.BLOCKS + parts.GUIDED
_LOAD = "*DLOAD\nUP, P2, 42.\n"
_MODEL = parts.PLAIN_BAR + parts.REFERENCE + parts.FIXED
_CUBE_CARDS = parts.mesh_cards({"P": block((0, 0, 0), (1, 1, 1), (1, 1, 1))})
_ASSEMBLY = f"""*Part, name=Cube
{_CUBE_CARDS}*Surface, name=Top
P, S2
*Solid Section, elset=P, material=Steel
*End Part
*Assembly, name=Whole
*Instance, name=C-1, part=Cube
*End Instance
*Instance, name=C-2, part=Cube
0., 0., 1.
0., 0., 1., 0., 0., 2., 90.
*End Instance
*Nset, nset=Up, instance=C-2
P_Z1
*Surface, name=Foot
C-2.P, S1
*End Assembly
{parts.STEEL}*Tie, name=T
Foot, C-1.Top
*Boundary
C-1.P_Z0, 1, 3
*Step
*Static
*Cload
Up, 3, 1.
*End Step
"""
_WARM = "*EXPANSION, ZERO=20.\n1.E-5\n*DENSITY\n7.8E-9\n"
_HEAVY = "*DLOAD\nBAR, GRAV, 9810., 0., 0., -1.\nBAR, CENTRIF, 10., 0., 0., 0., 1., 0., 0.\n"
#: A deck of each kind of cards.
DECKS: Mapping[str, str] = {
    "bar": parts.BAR + parts.END + parts.FREE_TO_CONTRACT + parts.step(parts.PULLED + "*NODE PRINT\nU, RF\n"),
    "contact": _BLOCKS + parts.law("EXPONENTIAL\n1.E-3, 42.", "0.2, 1.E5") + parts.PAIR + parts.step(_LOAD),
    "tabular": _BLOCKS + parts.law("TABULAR\n0., 0.\n84., 2.E-4") + parts.PAIR + parts.step(_LOAD),
    "tie": _BLOCKS + "*TIE, NAME=GLUE, POSITION TOLERANCE=0.1\nFEET, TABLE\n" + parts.step(_LOAD),
    "rigid": _MODEL + parts.RIGID + parts.step("*CLOAD\n501, 2, 3.\n502, 1, 7.\n"),
    "coupling": _MODEL + parts.KINEMATIC + parts.step("*CLOAD\n501, 2, 3.\n501, 4, 7.\n"),
    "spread": _MODEL + parts.SPREAD + parts.step("*CLOAD\n501, 2, 3.\n"),
    "columns": columns.columns(columns.BOTH, "", columns.DOWN),
    "bolt": _MODEL + "*NODE\n900, 0., 0., 0.\n*SURFACE, NAME=CUT\n2, S4\n"
    "*PRE-TENSION SECTION, SURFACE=CUT, NODE=900\n1., 0., 0.\n" + parts.step("*CLOAD\n900, 1, 420.\n")
    + parts.step("*BOUNDARY, FIXED\n900, 1, 1\n"),
    "axes": _MODEL + "*TRANSFORM, NSET=BAR_X1, TYPE=C\n0., 0., 0., 0., 0., 1.\n"
    "*EQUATION\n2\n17, 1, 1., 18, 2, -1.\n" + parts.step("*CLOAD\n20, 2, 5.\n"),
    "points": _MODEL + "*MPC\nPLANE, 17, 18, 19, 20\nTIE, 9, 10\n" + parts.step("*CLOAD\n20, 2, 5.\n"),
    "heat": parts.PLAIN_BAR.replace("*SOLID", _WARM + "*SOLID")
    + "*AMPLITUDE, NAME=A\n0., 0., 0.5, 1., 1., 0.5\n*INITIAL CONDITIONS, TYPE=TEMPERATURE\nBAR_X0, 20.\n"
    + parts.FIXED + parts.step("*TEMPERATURE, AMPLITUDE=A\nBAR_X1, 90.\n" + _HEAVY),
    "plate": parts.mesh_cards({"BAR": rectangle((0, 0), (2, 1), (2, 1))}, "CPS4R") + parts.STEEL
    + parts.SECTION + "4.\n" + parts.FIXED + parts.step("*CLOAD\nBAR_X1, 1, 3.\n"),
    "metal": parts.PLAIN_BAR.replace("*SOLID", "*PLASTIC\n200., 0.\n300., 0.1\n*SOLID") + parts.FIXED
    + parts.step("*CLOAD\nBAR_X1, 1, 3.\n", ", NLGEOM"),
    "rubber": parts.mesh_cards({"BAR": block((0, 0, 0), (1, 1, 1), (1, 1, 1))})
    + "*MATERIAL, NAME=STEEL\n*HYPERELASTIC, OGDEN, N=2\n2., 2., 0.5, -2., 0.01, 0.\n" + parts.SECTION
    + parts.FIXED + parts.step("*CLOAD\nBAR_X1, 1, 0.1\n", ", NLGEOM"),
    "assembly": _ASSEMBLY,
    "wood": parts.PLAIN_BAR.replace(
        "*ELASTIC\n210000., 0.", "*ELASTIC, TYPE=ORTHO\n2., 1., 3., 1., 1., 4., 1., 2.,\n3.", 1
    ) + "*ORIENTATION, NAME=O\n1., 0., 0., 0., 1., 0.\n" + parts.FIXED
    + parts.step("*CLOAD\nBAR_X1, 1, 3.\n"),
    "distribution": parts.PLAIN_BAR.replace(
        "*ELASTIC\n210000., 0.", "*ELASTIC, TYPE=ORTHO\n2., 1., 3., 1., 1., 4., 1., 2.,\n3.", 1
    ).replace("MATERIAL=STEEL\n*", "MATERIAL=STEEL, ORIENTATION=O\n*")
    + "*PARAMETER\nhalf = 2*1.5\n*DISTRIBUTION, NAME=D\n, 1., 0., 0., 0., 1., 0.\n2, 0., 0., 1., 0., 1., 0.\n"
    "*ORIENTATION, NAME=O\nD\n3, 30.\n" + parts.FIXED + parts.step("*CLOAD\nBAR_X1, 1, <half>\n"),
    "single": _MODEL + "*ORIENTATION, NAME=O, SYSTEM=CYLINDRICAL\n0., 0.5, 0.5, 1., 0.5, 0.5\n"
    + parts.KINEMATIC.replace("1, 6", "1, 2").replace("COUPLING,", "COUPLING, ORIENTATION=O,")
    + "*EQUATION\n3\n502, 1, 1., 501, 2, 1., 9, 1, -0.5\n2\nBAR_X1, 3, 1., 17, 3, -1.\n"
    + parts.step("*CLOAD\n501, 2, 3.\n502, 1, 7.\n"),
    "springs": _MODEL + "*ELEMENT, TYPE=SPRINGA, ELSET=S\n101, 17, 18\n*ELEMENT, TYPE=T3D2, ELSET=T\n"
    "102, 19, 9\n*ELEMENT, TYPE=SPRING1, ELSET=ONE\n103, 20\n*SPRING, ELSET=ONE\n2\n5.\n"
    "*SPRING, ELSET=S, NONLINEAR\n0., 0.\n30., 1.\n*SOLID SECTION, ELSET=T, MATERIAL=STEEL\n0.3\n"
    "*ELEMENT, TYPE=MASS, ELSET=M\n104, 12\n*MASS, ELSET=M\n2.\n*ELSET, ELSET=ALL\nS, 102, 1\n"
    + parts.FIXED + parts.step("*DLOAD\nM, GRAV, 9., 1., 0., 0.\n"),
}  # fmt: skip

_CUBE = """title = "a cube"
[meshes.cube]
{mesh}
[materials.steel]
young_modulus = 2.1e5
poisson_ratio = 0.3
[bodies.cube]
mesh = "cube"
material = "steel"{part}
[[supports]]
body = "cube"
surface = "{low}"
value = [0.0, 0.0, 0.0]
[[loads]]
kind = "traction"
body = "cube"
surface = "{high}"
value = [0.0, 0.0, -1.0]
"""
_ON_TOOL = """[[contacts]]
slave = {{ body = "cube", surface = "z0" }}
master = {{ obstacle = "triangulation", file = "{}" }}
"""


def _solid_stl() -> str:
    """Return the surface of a cube below the plane z = 0 as text."""
    mesh = block((-1, -1, -2), (2, 2, 0), (1, 1, 1))
    lines = ["solid tool"]
    for facet in np.concatenate(list(mesh.surfaces.values())):
        for three in (facet[[0, 1, 2]], facet[[0, 2, 3]]):
            corners = mesh.points[three]
            normal = np.cross(corners[1] - corners[0], corners[2] - corners[0])
            lines.append("facet normal {} {} {}".format(*normal))
            lines += ["outer loop", *("vertex {} {} {}".format(*x) for x in corners), "endloop", "endfacet"]
    return "\n".join([*lines, "endsolid tool", ""])


def _deck(name: str) -> Callable[[Path], tuple[Path, Path]]:
    def write(folder: Path) -> tuple[Path, Path]:
        path = folder / "model.inp"
        path.write_text(DECKS[name])
        return path, path

    return write


def _scene(name: str) -> Callable[[Path], tuple[Path, Path]]:
    def write(folder: Path) -> tuple[Path, Path]:
        path = folder / "scene.toml"
        path.write_bytes((ROOT / "demos" / "scenes" / f"{name}.toml").read_bytes())
        return path, path

    return write


def _mesh(
    write_mesh: Callable[[Path], Path], low: str, high: str, more: str = "", part: str = ""
) -> Callable[[Path], tuple[Path, Path]]:
    def write(folder: Path) -> tuple[Path, Path]:
        mesh, path = write_mesh(folder), folder / "scene.toml"
        path.write_text(_CUBE.format(mesh=f'file = "{mesh.name}"{more}', low=low, high=high, part=part))
        return path, mesh

    return write


def _msh(folder: Path) -> Path:
    path = folder / "cube.msh"
    path.write_bytes((ROOT / "tests" / "data" / "two_boxes_41.msh").read_bytes())
    return path


def _vtu(folder: Path) -> Path:
    import meshio

    path = folder / "cube.vtu"
    meshio.vtu.write(path, with_tags(joined(), "part"), binary=True)
    return path


def _step(folder: Path) -> Path:
    from tests.readers.msh_files import own_gmsh

    with own_gmsh() as gmsh, silenced(1):
        gmsh.model.occ.addBox(0, 0, 0, 1, 1, 1)
        gmsh.model.occ.synchronize()
        gmsh.write(str(folder / "cube.step"))
    return folder / "cube.step"


def _stl(folder: Path) -> tuple[Path, Path]:
    tool, path = folder / "tool.stl", folder / "scene.toml"
    tool.write_text(_solid_stl())
    mesh = 'shape = "block"\nlower = [0.0, 0.0, 0.0]\nupper = [1.0, 1.0, 1.0]\ncounts = [2, 2, 2]'
    text = _CUBE.format(mesh=mesh, low="z1", high="z1", part="")
    path.write_text(text.replace("[[loads]]", _ON_TOOL.format(tool.name) + "[[loads]]"))
    return path, tool


#: What is spoilt: by its name what writes it, and returns what is run and the file that is spoilt.
SUBJECTS: Mapping[str, Callable[[Path], tuple[Path, Path]]] = {
    **{f"deck {name}": _deck(name) for name in DECKS},
    **{f"scene {name}": _scene(name) for name in ("two_blocks", "hertz", "sheared_block", "plate_on_roller")},
    "mesh msh": _mesh(_msh, "bottom", "interface", part='\npart = "table"'),
    "mesh vtu": _mesh(_vtu, "11", "11", part='\npart = "1"'),
    "mesh step": _mesh(_step, "1", "2", "\nsize = 1.0"),
    "tool stl": _stl,
}
