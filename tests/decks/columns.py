"""Decks of two columns whose tops one node drives."""

from __future__ import annotations

from fenics_contact import BodyMesh
from fenics_contact.gallery import block
from tests.decks.texts import mesh_cards, step

#: Two columns of 1 × 1 × 1 side by side, E = 1000 and no Poisson's ratio.
COLUMNS = {"A": block((0, 0, 0), (1, 1, 1), (1, 1, 1)), "B": block((3, 0, 0), (4, 1, 1), (1, 1, 1))}
SOFT = "*MATERIAL, NAME=M\n*ELASTIC\n1000., 0.\n"
SECTION = "*SOLID SECTION, ELSET={}, MATERIAL=M\n"
HELD = "*BOUNDARY\nA_Z0, 1, 3\nB_Z0, 1, 3\n"
NODES = "*NODE\n21, 0., 0., 1.\n22, 0., 0., 1.\n"
RIGID = "*RIGID BODY, NSET={}, REF NODE=21, ROT NODE=22\n"
BOTH = RIGID.format("A_Z1") + RIGID.format("B_Z1")
UPRIGHT = "22, 1, 3\n"
COUPLED = "".join(
    f"*SURFACE, NAME=S{name}\n{k}, S2\n*COUPLING, REF NODE=21, SURFACE=S{name}, CONSTRAINT NAME=C{name}\n"
    "*KINEMATIC\n1, 3\n" for k, name in enumerate("AB", 1)
)  # fmt: skip
DOWN = "*CLOAD\n21, 3, -3.\n"
ON_A = "*CLOAD\nA_Z1, 3, -0.75\n"


def columns(cards: str, held: str, load: str, large: str = "") -> str:
    meshes: dict[str, BodyMesh] = dict(COLUMNS)
    sections = SOFT + "".join(SECTION.format(name) for name in meshes)
    return mesh_cards(meshes) + NODES + sections + cards + HELD + held + step(load, large)
