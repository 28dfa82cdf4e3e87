"""Small decks for tests, written from meshes of the gallery."""

from __future__ import annotations

from collections.abc import Mapping
from pathlib import Path

import numpy as np

from fenics_contact import BodyMesh
from fenics_contact.gallery import block
from fenics_contact.mesh.collapsed import SHAPES, by_shape

#: Name of the elements of each type of cells.
ELEMENTS = {
    "hexahedron": "C3D8", "tetrahedron": "C3D4", "tetrahedron10": "C3D10",
    "hexahedron27": "C3D20R", "quadrilateral9": "CPS8R",
    "quadrilateral": "CPS4", "triangle": "CPS3", "triangle6": "CPS6",
}  # fmt: skip


def mesh_cards(meshes: Mapping[str, BodyMesh], element: str = "", sets: bool = True) -> str:
    """Return nodes, elements and sets of bodies: each side z1 of body A is the node set A_Z1.

    Of complete quadratic cells those without centres are written.
    """
    nodes, rest, first, count = [], [], 1, 1
    for name, mesh in meshes.items():
        blocks = []
        for shape, (_, own) in by_shape(mesh.cells, mesh.dim).items():
            lean = own[:, : SHAPES[shape].counts[mesh.order - 1]]
            name_of = "C3D{}" if mesh.has_several_shapes else ELEMENTS[mesh.cell_type]
            blocks.append((element or name_of, lean))
        kept = np.unique(np.concatenate([lean.ravel() for _, lean in blocks]))
        points = np.pad(mesh.points[kept], ((0, 0), (0, 3 - mesh.dim)))
        number = np.full(mesh.n_nodes, -1)
        number[kept] = first + np.arange(len(kept))
        nodes += [f"{first + k}, {x:.17g}, {y:.17g}, {z:.17g}" for k, (x, y, z) in enumerate(points)]
        for letters, lean in blocks:
            rest.append(f"*ELEMENT, TYPE={letters.format(lean.shape[1])}, ELSET={name}")
            for cell in number[lean]:
                line = ", ".join(map(str, [count, *cell]))
                rest += (
                    [f"{', '.join(line.split(', ')[:16])},", ", ".join(line.split(", ")[16:])]
                    if len(cell) > 15
                    else [line]
                )
                count += 1
        for side, facets in mesh.surfaces.items() if sets else ():
            rest.append(f"*NSET, NSET={name}_{side.upper()}")
            rest += [f"{node}," for node in np.unique(number[facets]) if node > 0]
        first += len(kept)
    return "\n".join(["*NODE", *nodes, *rest, ""])


STEEL = """*MATERIAL, NAME=STEEL
*ELASTIC
210000., 0.3
"""


def deck(folder: Path, text: str, name: str = "model.inp") -> Path:
    """Write a deck."""
    path = folder / name
    path.write_text(text)
    return path


SECTION = "*SOLID SECTION, ELSET=BAR, MATERIAL=STEEL\n"
#: A corner, a line and a side hold a bar so that it may contract.
FREE_TO_CONTRACT = "*BOUNDARY\nBAR_X0, 1\nBAR_Y0, 2\nBAR_Z0, 3\n"
BAR = mesh_cards({"BAR": block((0, 0, 0), (3, 1, 1), (3, 2, 1))}) + STEEL + SECTION


def step(cards: str, more: str = "") -> str:
    return f"*STEP{more}\n*STATIC\n{cards}*END STEP\n"


PULLED = "*DLOAD\nEND, P4, -100.\n"
END = "*ELSET, ELSET=END\n5, 6\n"
PLAIN_BAR = mesh_cards({"BAR": block((0, 0, 0), (4, 1, 1), (4, 1, 1))}) + STEEL.replace("0.3", "0.") + SECTION
FIXED = "*BOUNDARY\nBAR_X0, 1, 3\n"
#: Two nodes beside the bar: they drive its end by displacements and rotations.
REFERENCE = (
    "*NODE, NSET=REF\n501, 4., 0.5, 0.5\n*NODE, NSET=ROT\n502, 4., 0.5, 0.5\n*SURFACE, NAME=TIP\n4, S4\n"
)
RIGID = "*RIGID BODY, NSET=BAR_X1, REF NODE=501, ROT NODE=502\n"
KINEMATIC = "*COUPLING, REF NODE=501, SURFACE=TIP, CONSTRAINT NAME=C\n*KINEMATIC\n1, 6\n"
SPREAD = "*COUPLING, REF NODE=501, SURFACE=TIP, CONSTRAINT NAME=C\n*DISTRIBUTING\n1, 6\n"
#: Both blocks have no lateral contraction and are 1 mm high; meshes match.
BLOCKS = (
    mesh_cards({"LOW": block((0, 0, 0), (2, 2, 1), (2, 2, 1)), "UP": block((0, 0, 1), (2, 2, 2), (2, 2, 1))})
    + STEEL.replace("0.3", "0.")
    + "*SOLID SECTION, ELSET=LOW, MATERIAL=STEEL\n*SOLID SECTION, ELSET=UP, MATERIAL=STEEL\n"
    "*SURFACE, NAME=FEET\nUP, S1\n*SURFACE, NAME=TABLE\nLOW, S2\n*SURFACE, NAME=NODES, TYPE=NODE\nUP_Z0\n"
    "*BOUNDARY\nLOW_Z0, 1, 3\n"
)
PAIR = "*CONTACT PAIR, INTERACTION=DRY, TYPE=SURFACE TO SURFACE\nFEET, TABLE\n"
GUIDED = "UP_X0, 1\nUP_Y0, 2\n"


def law(behavior: str, friction: str = "") -> str:
    text = "*SURFACE INTERACTION, NAME=DRY\n*SURFACE BEHAVIOR, PRESSURE-OVERCLOSURE=" + behavior + "\n"
    return text + (f"*FRICTION\n{friction}\n" if friction else "")


def pressed(contact: str, more: str = "", step: str = "*DLOAD\nUP, P2, 42.\n") -> str:
    return BLOCKS + GUIDED + contact + more + "*STEP\n*STATIC\n" + step + "*END STEP\n"
