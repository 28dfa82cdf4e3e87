"""A tie between two surfaces of one body closes a slit in it."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

from fenics_contact.gallery import block
from tests.decks.solved import solved
from tests.decks.texts import SECTION, STEEL, mesh_cards, step

#: Two columns on a common base; nodes are numbered along z, y, x, elements 2 and 4 are the upper ones.
MESH = block((0, 0, 0), (2, 1, 2), (2, 1, 2))
LOAD = "*BOUNDARY\nBAR_Z0, 1, 3\n" + step("*CLOAD\n3, 1, 40.\n18, 3, 90.\n15, 2, 20.\n")


#: Both sides of the slit between the upper elements.
SIDES = "*SURFACE, NAME=LEFT\n2, S4\n*SURFACE, NAME=RIGHT\n4, S6\n"
SIDES += "*TIE, NAME=T, POSITION TOLERANCE=0.01\nRIGHT, LEFT\n"


def slit(gap: float) -> str:
    """The mesh with nodes of its own at the top of the second column, which begins a gap farther on."""
    text = mesh_cards({"BAR": MESH})
    new = f"*NODE\n100, {1.0 + gap}, 0., 2.\n101, {1.0 + gap}, 1., 2.\n"
    upper = "4, 8, 14, 17, 11, 9, 15, 18, 12"
    assert upper in text
    text = text.replace(upper, upper.replace(" 9,", " 100,").replace(" 12", " 101"))
    return text.replace("*NODE\n", new, 1) + STEEL + SECTION


def test_a_tie_within_a_body_closes_its_slit(tmp_path: Path) -> None:
    _, state, moved, _ = solved(tmp_path, slit(0.0) + SIDES + LOAD)
    _, _, whole, _ = solved(tmp_path, mesh_cards({"BAR": MESH}) + STEEL + SECTION + LOAD)
    _, _, apart, _ = solved(tmp_path, slit(0.0) + LOAD)
    for node, value in whole.items():
        np.testing.assert_allclose(moved[node], value, rtol=1e-7, atol=1e-13)
    assert max(abs(apart[k] - whole[k]).max() for k in whole) > 1e-6
    assert state.reactions()["BAR BAR_Z0"].force[2] == pytest.approx(-90.0, rel=1e-8)


def test_a_slit_wider_than_the_tolerance_stays_open(tmp_path: Path) -> None:
    _, _, moved, _ = solved(tmp_path, slit(0.05) + SIDES + LOAD)
    _, _, apart, _ = solved(tmp_path, slit(0.05) + LOAD)
    for node, value in apart.items():
        np.testing.assert_allclose(moved[node], value, rtol=1e-9)
