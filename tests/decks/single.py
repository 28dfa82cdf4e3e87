"""Decks of one element of any type, held at its lower side and loaded at a corner of the upper one."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path

import numpy as np

from tests.decks.texts import STEEL, deck

Edges = Sequence[tuple[int, int]]
_CORNERS: dict[str, tuple[np.ndarray, Edges]] = {
    "hexahedron": (
        np.array([(0, 0, 0), (1, 0, 0), (1, 1, 0), (0, 1, 0), (0, 0, 1), (1, 0, 1), (1, 1, 1), (0, 1, 1)]),
        [(0, 1), (1, 2), (2, 3), (3, 0), (4, 5), (5, 6), (6, 7), (7, 4), (0, 4), (1, 5), (2, 6), (3, 7)],
    ),
    "tetrahedron": (np.vstack([np.zeros(3), np.eye(3)]), [(0, 1), (1, 2), (2, 0), (0, 3), (1, 3), (2, 3)]),
    "prism": (
        np.array([(0, 0, 0), (1, 0, 0), (0, 1, 0), (0, 0, 1), (1, 0, 1), (0, 1, 1)]),
        [(0, 1), (1, 2), (2, 0), (3, 4), (4, 5), (5, 3), (0, 3), (1, 4), (2, 5)],
    ),
    "quadrilateral": (
        np.array([(1, 0, 0), (2, 0, 0), (2, 1, 0), (1, 1, 0)]),
        [(0, 1), (1, 2), (2, 3), (3, 0)],
    ),
    "triangle": (np.array([(1, 0, 0), (2, 0, 0), (1, 1, 0)]), [(0, 1), (1, 2), (2, 0)]),
}
_SHAPES = {
    (3, 8): "hexahedron", (3, 20): "hexahedron", (3, 4): "tetrahedron", (3, 10): "tetrahedron",
    (3, 6): "prism", (3, 15): "prism", (2, 4): "quadrilateral", (2, 8): "quadrilateral",
    (2, 3): "triangle", (2, 6): "triangle",
}  # fmt: skip


def single(folder: Path, kind: str) -> Path:
    """Write the deck of one element number 7; in the plane 0.5 thick."""
    dim = 3 if kind.startswith("C3D") else 2
    count = int(kind[3:].rstrip("R"))
    corners, edges = _CORNERS[_SHAPES[dim, count]]
    points = np.vstack([corners, [corners[list(edge)].mean(axis=0) for edge in edges]])[:count]
    low, high = (np.flatnonzero(points[:, dim - 1] == end) + 1 for end in (0, 1))
    numbers = [f"{number}," for number in range(1, count + 1)]
    lines = [
        "*NODE, NSET=NALL", *(f"{k}, {x}, {y}, {z}" for k, (x, y, z) in enumerate(points, start=1)),
        f"*ELEMENT, TYPE={kind}, ELSET=EALL", "7," + "".join(numbers[:10]),
        *["".join(numbers[10:])][: count // 11],
        "*NSET, NSET=LOW", *(f"{number}," for number in low),
        STEEL + "*SOLID SECTION, ELSET=EALL, MATERIAL=STEEL", *["0.5"][: kind.startswith("CP")],
        f"*BOUNDARY\nLOW, 1, {dim}\n*STEP\n*STATIC\n*CLOAD\n{high[0]}, {dim}, -100.\n{high[0]}, 1, 37.",
        "*NODE FILE\nU, RF\n*EL FILE\nS, E\n*NODE PRINT, NSET=NALL, TOTALS=YES\nU, RF",
        "*EL PRINT, ELSET=EALL\nS, E\n*END STEP\n",
    ]  # fmt: skip
    return deck(folder, "\n".join(lines), f"{kind}.inp")


#: Two blocks, C3D8, the upper one pressed and then pushed: contact of nodes on a surface, with friction.
TWO_BLOCKS = (
    """*NODE
1, 0, 0, 0\n2, 1, 0, 0\n3, 1, 1, 0\n4, 0, 1, 0\n5, 0, 0, 1\n6, 1, 0, 1\n7, 1, 1, 1\n8, 0, 1, 1
101, 0, 0, 1\n102, .9, 0, 1\n103, .9, .9, 1\n104, 0, .9, 1
105, 0, 0, 2\n106, .9, 0, 2\n107, .9, .9, 2\n108, 0, .9, 2
*ELEMENT, TYPE=C3D8, ELSET=LOW
1, 1, 2, 3, 4, 5, 6, 7, 8
*ELEMENT, TYPE=C3D8, ELSET=UP
2, 101, 102, 103, 104, 105, 106, 107, 108
*SURFACE, NAME=SL
UP, S1
*SURFACE, NAME=MA
LOW, S2
*SURFACE INTERACTION, NAME=SI
*SURFACE BEHAVIOR, PRESSURE-OVERCLOSURE=LINEAR
1e7
*FRICTION
0.3, 1e6
*CONTACT PAIR, INTERACTION=SI, TYPE=NODE TO SURFACE
SL, MA
*NSET, NSET=B
1, 2, 3, 4
*NSET, NSET=T
105, 106, 107, 108
*ELSET, ELSET=EALL
LOW, UP
"""
    + STEEL
    + """*SOLID SECTION, ELSET=EALL, MATERIAL=STEEL
*BOUNDARY
B, 1, 3
*STEP
*STATIC
*BOUNDARY
T, 1, 2, 0.
T, 3, 3, -1e-3
*NODE FILE
U, RF
*EL FILE
S, E
*CONTACT FILE
CDISP, CSTRESS
*CONTACT PRINT
CDIS, CSTR
*CONTACT PRINT, MASTER=MA, SLAVE=SL
CF
*END STEP
*STEP
*STATIC
*BOUNDARY
T, 1, 1, 1e-3
*END STEP
"""
)
