"""Composite shells of decks, compared with what CalculiX 2.20 prints for the same decks."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

from fenics_contact.decks import read_deck
from fenics_contact.materials.laminate import Laminate
from fenics_contact.readers.deck_cards import DeckError
from tests.decks.plates import CLAMPED, PLATE, TIP, solved, text_of, triangles

FIBRES = """\
*MATERIAL, NAME=F
*ELASTIC, TYPE=ENGINEERING CONSTANTS
175000., 7000., 7000., 0.25, 0.25, 0.01, 3500., 3500.
1400., 293.
*EXPANSION, TYPE=ORTHO
1e-6, 3e-5, 3e-5
*DENSITY
2.
*ORIENTATION, NAME=O0
1., 0., 0., 0., 1., 0.
*ORIENTATION, NAME=O45
1., 1., 0., -1., 1., 0.
*ORIENTATION, NAME=O90
0., 1., 0., -1., 0., 0.
"""
CROSS = "1., , F, O0\n1., , F, O90\n1., , F, O90\n1., , F, O0\n"
UNEVEN = "1., , F, O0\n1.5, , F, O45\n1.5, , F, O90\n"
COATED = "1., , M\n3., , F, O90\n"
PRESSED, HEATED = "*DLOAD\nALL, P, 1.", "*TEMPERATURE\nNALL, 50."


def laminated(kind: str, plies: str, loads: str, **given: str) -> str:
    facets = triangles(PLATE[1], 6) if kind == "S6" else PLATE[1]
    text = text_of(PLATE[0], {kind: facets}, CLAMPED, loads, **given)
    old = "*SHELL SECTION, ELSET=ALL, MATERIAL=M\n4.0\n"
    assert old in text
    return text.replace(old, f"{FIBRES}*SHELL SECTION, ELSET=ALL, COMPOSITE\n{plies}")


@pytest.mark.filterwarnings("ignore")
@pytest.mark.parametrize(
    ("kind", "plies", "loads", "calculix"),
    [
        ("S8R", CROSS, PRESSED, (2.860504e-05, 6.213533e-16, 4.702989e-01)),
        ("S8R", UNEVEN, PRESSED, (-1.035573e-01, 6.039466e-02, 2.603922e00)),
        ("S8R", COATED, PRESSED, (-1.236052e-01, 3.431722e-13, 2.863271e00)),
        ("S6", UNEVEN, PRESSED, (-1.035040e-01, 5.917043e-02, 2.601538e00)),
        ("S8R", UNEVEN, HEATED, (2.624609e-02, -3.027386e-02, -3.168505e-01)),
    ],
    ids=["cross ply", "three angles", "two materials", "S6", "heated"],
)
def test_laminates_move_as_calculix_prints(kind, plies, loads, calculix, tmp_path: Path) -> None:
    cold = "*INITIAL CONDITIONS, TYPE=TEMPERATURE\nNALL, 0."
    deck, moved, _ = solved(tmp_path, laminated(kind, plies, loads, model=cold))
    np.testing.assert_allclose(moved[TIP], calculix, atol=1e-6 * np.abs(calculix).max())
    assert any("their stresses are those of the mean ply" in note for note in deck.notes)


def test_equal_plies_are_one_and_weigh_as_the_whole(tmp_path: Path) -> None:
    """Two halves of one material: but for two points more the plate without plies."""
    weight = "*DLOAD\nALL, GRAV, 10., 0., 0., -1."
    plain = text_of(PLATE[0], {"S8R": PLATE[1]}, CLAMPED, weight)
    _, expected, _ = solved(tmp_path, plain)
    deck, moved, reaction = solved(tmp_path, laminated("S8R", "1., , M\n3., , M\n", weight))
    (material,) = deck.scene.bodies["ALL"].materials
    assert isinstance(material, Laminate)
    assert [where for _, where in material.plies] == [((0.0, 0.25), (0.25, 1.0))]
    assert moved[TIP][2] == pytest.approx(expected[TIP][2], rel=2e-4)
    assert reaction[2] == pytest.approx(32000.0, rel=1e-6)
    _, _, heavier = solved(tmp_path, laminated("S8R", COATED, weight))
    assert heavier[2] == pytest.approx(32000.0 * (1 + 3 * 2) / 4, rel=1e-6)


@pytest.mark.parametrize(
    ("plies", "step", "message"),
    [
        ("1.\n", "*STEP\n*STATIC", "needs thickness, points, material and orientation of a ply"),
        ("0., , F\n", "*STEP\n*STATIC", "the thickness of a ply must be above zero, got 0"),
        ("1., , G\n", "*STEP\n*STATIC", "material 'G'"),
        ("1., , F, O1\n", "*STEP\n*STATIC", "orientation 'O1'"),
        ("1., , M\n2., , M\n", "*STEP, NLGEOM\n*STATIC", "COMPOSITE is for linear materials"),
    ],
)
def test_mistakes_about_plies_are_refused(plies: str, step: str, message: str, tmp_path: Path) -> None:
    path = tmp_path / "plies.inp"
    path.write_text(laminated("S8R", plies, PRESSED, step=step))
    with pytest.raises(DeckError, match=rf"plies.inp, line \d+: .*{message}"):
        read_deck(path)
