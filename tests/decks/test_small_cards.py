"""Parameters, distributions, turned axes and other small cards of decks, and edges that are straightened."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest
from mpi4py import MPI

from fenics_contact.decks import DeckError, read_deck
from fenics_contact.gallery import block
from fenics_contact.materials.plastic import J2Plasticity
from tests.decks.texts import FIXED, PAIR, PLAIN_BAR, SECTION, STEEL, deck, law, mesh_cards, pressed, step

TIP = step("*DLOAD\n4, P4, -210.\n")
WOOD = (
    "*MATERIAL, NAME=STEEL\n*ELASTIC, TYPE=ENGINEERING CONSTANTS\n"
    "1000., 400., 200., 0., 0., 0., 50., 50.,\n50.\n"
)
TWO = mesh_cards({"BAR": block((0, 0, 0), (2, 1, 1), (2, 1, 1))})
PULLED = FIXED + step("*DLOAD\n2, P4, -2.\n")
AXES = "*ORIENTATION, NAME=O\n{}\n"
ORIENTED = SECTION.replace("MATERIAL", "ORIENTATION=O, MATERIAL")


def tip(folder: Path, text: str) -> float:
    found = read_deck(deck(folder, text))
    (state,) = found.solve(MPI.COMM_SELF, tolerance=1e-11)
    (body,) = found.scene.bodies
    return float(state.gather_displacement(body)[:, 0].max())


def refused(folder: Path, text: str, words: str) -> None:
    with pytest.raises(DeckError, match=words):
        read_deck(deck(folder, text))


def test_parameters_stand_for_numbers(tmp_path: Path) -> None:
    given = "*PARAMETER\nhalf = 50.0*(3 - 1);  # of the length\nPULL = -half**2/100 - 2*sqrt(4)*27.5\n"
    assert tip(tmp_path, given + PLAIN_BAR + FIXED + TIP.replace("-210.", "<pull>")) == pytest.approx(4e-3)


@pytest.mark.parametrize(
    ("line", "words"),
    [
        ("pull", "needs a name, = and a formula, got 'pull'"),
        ("pull = open(1)", r"'open\(1\)' has no value"),
        ("pull = 1/0", r"'1/0' has no value \(division by zero\)"),
        ("pul = 1", "parameter 'PULL' is not there; did you mean PUL"),
    ],
)
def test_parameters_without_a_value_are_refused(tmp_path: Path, line: str, words: str) -> None:
    text = f"*PARAMETER\n{line}\n" + PLAIN_BAR + FIXED + TIP.replace("-210.", "<pull>")
    refused(tmp_path, text, words)


def test_axes_of_a_material_turn_about_one_of_them(tmp_path: Path) -> None:
    """E is 1000, 400, 200 along the axes; σ = 2 over a length of 2."""
    for lines, young in (
        ("1., 0., 0., 0., 1., 0.\n3, 90.", 400.0),
        ("1., 0., 0., 0., 1., 0.\n2, 90.", 200.0),
    ):
        text = TWO + WOOD + AXES.format(lines) + ORIENTED
        assert tip(tmp_path, text + PULLED) == pytest.approx(4.0 / young, rel=1e-9)
    refused(
        tmp_path, TWO + WOOD + AXES.format("1., 0., 0., 0., 1., 0.\n4, 90.") + ORIENTED + PULLED, "an axis"
    )


def test_a_distribution_gives_axes_element_by_element(tmp_path: Path) -> None:
    """The first element has E = 1000 along the bar, the second 200."""
    table = "*DISTRIBUTION, NAME=D\n, 1., 0., 0., 0., 1., 0.\n{}, 0., 0., 1., 0., 1., 0.\n"
    text = TWO + WOOD + table + AXES.format("D") + ORIENTED + PULLED
    assert tip(tmp_path, text.format(2)) == pytest.approx(2.0 / 1000.0 + 2.0 / 200.0, rel=1e-9)
    found = read_deck(deck(tmp_path, text.format(2)))
    assert len(found.scene.bodies["BAR"].materials) == 2
    refused(tmp_path, text.format(7), "element 7 is not there")
    refused(tmp_path, text.replace("\n, 1.", "\n1, 1.").format(2), "needs a first line without elements")


def test_a_plastic_table_that_begins_above_zero_is_constant_before(tmp_path: Path) -> None:
    """CalculiX 2.20 takes the first stress up to the first strain."""
    metal = STEEL + "*PLASTIC\n3., 0.1\n4., 0.2\n"
    found = read_deck(deck(tmp_path, TWO + metal + SECTION + FIXED + TIP.replace("4,", "2,")))
    (material,) = found.scene.bodies["BAR"].materials
    assert isinstance(material, J2Plasticity)
    assert (material.yield_stress, material.hardening_curve) == (3.0, ((0.1, 3.0), (0.2, 4.0)))


def test_cards_of_output_and_meshing_are_noted(tmp_path: Path) -> None:
    text = PLAIN_BAR.replace("ELSET=BAR, MAT", "ELSET=BAR, CONTROLS=C, MAT") + "*SECTION CONTROLS, NAME=C\n"
    text += FIXED + TIP.replace("*STEP", "*STEP, UNSYMM=YES").replace(
        "*END", "*REFINE MESH, LIMIT=50.\nS\n*END"
    )
    notes = " ".join(read_deck(deck(tmp_path, text)).notes)
    for words in ("solved on the mesh as it is given", "UNSYMM has no effect", "CONTROLS has no effect"):
        assert words in notes


#: A tetrahedron of ten nodes whose edge along x has its middle at the number given.
TETRAHEDRON = """*NODE
1, 0., 0., 0.
2, 1., 0., 0.
3, 0., 1., 0.
4, 0., 0., 1.
5, {}, 0., 0.
6, 0.5, 0.5, 0.
7, 0., 0.5, 0.
8, 0., 0., 0.5
9, 0.5, 0., 0.5
10, 0., 0.5, 0.5
*ELEMENT, TYPE=C3D10, ELSET=BAR
1, 1, 2, 3, 4, 5, 6, 7, 8, 9, 10
"""


def test_edges_that_turn_elements_inside_out_are_straightened(tmp_path: Path) -> None:
    rest = STEEL + SECTION + "*BOUNDARY\n1, 1, 3\n3, 1, 3\n4, 1, 3\n" + step("*CLOAD\n2, 1, 1.\n")
    found = read_deck(deck(tmp_path, TETRAHEDRON.format(-0.4) + rest))
    (note,) = [each for each in found.notes if "straight" in each]
    assert "1 nodes in the middles of edges move by up to 0.9" in note
    straight = read_deck(deck(tmp_path, TETRAHEDRON.format(0.5) + rest, "straight.inp"))
    meshes = [each.scene.bodies["BAR"].mesh.points for each in (found, straight)]
    np.testing.assert_allclose(*meshes, atol=1e-15)
    assert not any("straight" in each for each in straight.notes)
    refused(tmp_path, TETRAHEDRON.format(0.5).replace("2, 1., 0.", "2, -1., 0.") + rest, "positive Jacobian")


def test_types_of_contact_pairs_are_read_without_blanks(tmp_path: Path) -> None:
    """And without what is behind them, as CalculiX overlooks it."""
    for kind in ("SURFACETOSURFACE", "Surface to surface sheet down"):
        text = pressed(PAIR.replace("SURFACE TO SURFACE", kind), law("HARD"))
        assert len(read_deck(deck(tmp_path, text)).scene.contacts) == 1
    refused(tmp_path, pressed(PAIR.replace("SURFACE TO", "EDGE TO"), law("HARD")), "TYPE=EDGE TO SURFACE")
