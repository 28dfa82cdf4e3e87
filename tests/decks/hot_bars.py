"""Bars that conduct heat, alone, one on another, and expanding, as cards of decks."""

from __future__ import annotations

from fenics_contact.gallery import block
from tests.decks.texts import mesh_cards

COPPER = "*MATERIAL, NAME=COPPER\n*CONDUCTIVITY\n0.4\n*DENSITY\n9.E-6\n*SPECIFIC HEAT\n400.\n"
SECTION = "*SOLID SECTION, ELSET=BAR, MATERIAL=COPPER\n"
#: 4 long, 1 wide and high; face 6 of the first element is at x = 0, face 4 of the last one at x = 4.
MESH = mesh_cards({"BAR": block((0, 0, 0), (4, 1, 1), (4, 1, 1))})
BAR = MESH + COPPER + SECTION
COLD = "*BOUNDARY\nBAR_X0, 11, 11, 20.\n"
TWO = (
    mesh_cards({"LOW": block((0, 0, 0), (1, 1, 2), (1, 1, 2)), "UP": block((0, 0, 2), (1, 1, 4), (2, 2, 2))})
    + COPPER
    + "*SOLID SECTION, ELSET=LOW, MATERIAL=COPPER\n*SOLID SECTION, ELSET=UP, MATERIAL=COPPER\n"
    "*SURFACE, NAME=ABOVE, TYPE=NODE\nUP_Z0\n*SURFACE, NAME=BELOW, TYPE=NODE\nLOW_Z1\n"
)
ENDS = "*BOUNDARY\nLOW_Z0, 11, 11, 0.\nUP_Z1, 11, 11, 100.\n"
PAIR = "*CONTACT PAIR, INTERACTION=DRY, TYPE=SURFACE TO SURFACE\nABOVE, BELOW\n"
DRY = "*SURFACE INTERACTION, NAME=DRY\n*SURFACE BEHAVIOR, PRESSURE-OVERCLOSURE=LINEAR\n1.E6\n"
START = "*INITIAL CONDITIONS, TYPE=TEMPERATURE\nBAR_ALL, 20.\n"
ALL = "*NSET, NSET=BAR_ALL, ELSET=BAR\n"
EXPANDS = MESH + COPPER + "*ELASTIC\n1.E5, 0.\n*EXPANSION\n1.E-5\n" + SECTION + ALL + START
CLAMPED = "*BOUNDARY\nBAR_X0, 1, 1\nBAR_Y0, 2, 2\nBAR_Z0, 3, 3\n"
WARM = "*BOUNDARY\nBAR_X0, 11, 11, 20.\nBAR_X1, 11, 11, 60.\n"


def steady(cards: str) -> str:
    return f"*STEP\n*HEAT TRANSFER, STEADY STATE\n{cards}*END STEP\n"
