"""Small decks for tests, written from meshes of the gallery."""

from __future__ import annotations

from collections.abc import Mapping
from pathlib import Path

import numpy as np

from fenics_contact import BodyMesh
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
