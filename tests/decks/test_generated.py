"""Nodes and elements that cards generate, surfaces of elements alone, forces per area along a direction."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest
from mpi4py import MPI

from fenics_contact.decks import DeckError, read_deck
from tests.decks.texts import BAR as LONG_BAR
from tests.decks.texts import FREE_TO_CONTRACT, SECTION, STEEL, deck, step

#: Two layers of two rows of three cubes of size 1, and a quarter of a ring with radii 1 and 3.
BLOCKS = """*NODE
1, 0., 0., 0.
4, 3., 0., 0.
31, 0., 2., 0.
34, 3., 2., 0.
*NGEN, NSET=NEAR
1, 4
*NGEN, NSET=FAR
31, 34
*NFILL, NSET=BOTTOM
NEAR, FAR, 2, 15
*NODE
201, 0., 0., 2.
*NGEN
1, 201, 100
*NODE, NSET=TOP
201, 0., 0., 2.
202, 1., 0., 2.
203, 2., 0., 2.
204, 3., 0., 2.
216, 0., 1., 2.
217, 1., 1., 2.
218, 2., 1., 2.
219, 3., 1., 2.
231, 0., 2., 2.
232, 1., 2., 2.
233, 2., 2., 2.
234, 3., 2., 2.
*NFILL, NSET=ALL
BOTTOM, TOP, 2, 100
*ELEMENT, TYPE=C3D8
1, 1, 2, 17, 16, 101, 102, 117, 116
*ELGEN, ELSET=BAR
1, 3, 1, 1, 2, 15, 10, 2, 100, 100
"""
RING = """*NODE
1, 1., 0.
5, 0., 1.
41, 3., 0.
45, 0., 3.
*NGEN, NSET=IN, LINE=C
1, 5, 1, , 0., 0., 0.
*NGEN, NSET=OUT, LINE=C
41, 45
*NFILL
IN, OUT, 4, 10
*ELEMENT, TYPE=CPS4
1, 1, 11, 12, 2
*ELGEN, ELSET=BAR
1, 4, 10, 1, 4, 1, 10
"""
HELD = "*BOUNDARY\nALL, 2, 3\nX0, 1\n*NSET, NSET=X0\n1, 16, 31, 101, 116, 131, 201, 216, 231\n"


def test_generated_elements_are_as_if_listed(tmp_path: Path) -> None:
    text = BLOCKS + STEEL.replace("0.3", "0.") + SECTION
    (body,) = (read := read_deck(deck(tmp_path, text + HELD + step("")))).scene.bodies.values()
    assert body.mesh.n_cells == 12
    grid = np.stack(np.meshgrid(range(4), range(3), range(3)), axis=-1).reshape(-1, 3)
    assert set(map(tuple, body.mesh.points)) == set(map(tuple, grid.astype(float)))
    assert body.mesh.volume == pytest.approx(12.0)
    rows = np.add.outer([1, 2, 3], [0, 10, 100, 110])
    assert sorted(read.element_numbers["BAR"]) == sorted(rows.ravel())
    assert len(read.node_sets["BOTTOM"]) == len(read.node_sets["TOP"]) == 12


def test_arcs_are_divided_by_equal_angles(tmp_path: Path) -> None:
    text = RING + STEEL + SECTION + "1.,\n*BOUNDARY\nIN, 1, 2\n" + step("")
    (body,) = read_deck(deck(tmp_path, text)).scene.bodies.values()
    radii, angles = np.linalg.norm(body.mesh.points, axis=1), np.arctan2(*body.mesh.points.T[::-1])
    assert set(radii.round(9)) == {1.0, 1.5, 2.0, 2.5, 3.0}
    assert set((angles / (np.pi / 8)).round(9)) == {0.0, 1.0, 2.0, 3.0, 4.0}


def test_nodes_may_be_given_by_radius_and_angle(tmp_path: Path) -> None:
    polar = RING.replace("*NODE\n", "*NODE, SYSTEM=C\n").replace("5, 0., 1.", "5, 1., 90.")
    polar = polar.replace("45, 0., 3.", "45, 3., 90.")
    rest = STEEL + SECTION + "1.,\n*BOUNDARY\nIN, 1, 2\n" + step("")
    plain, turned = (
        read_deck(deck(tmp_path, text + rest)).scene.bodies["BAR"].mesh.points for text in (RING, polar)
    )
    np.testing.assert_allclose(turned, plain, atol=1e-14)


@pytest.mark.parametrize(
    ("given", "other", "words"),
    [
        ("1, 4\n*NGEN, NSET=FAR", "1, 4, 2\n*NGEN, NSET=FAR", r"line 7: \*NGEN: the increment 2 does not"),
        ("NSET=FAR", "NSET=FAR, LINE=P", r"nodes are made on lines and arcs \(LINE=C\) alone"),
        ("NSET=FAR", "NSET=FAR, LINE=C", r"both ends of an arc need one distance .*, got 2, 3.6"),
        ("31, 34\n*NFILL", "31, 35\n*NFILL", r"line 9: \*NGEN: node 35 is not there"),
        ("NEAR, FAR, 2, 15", "NEAR, TO, 2, 15", r"line 11: \*NFILL: node set 'TO' is not there"),
        ("NEAR, FAR, 2, 15", "NEAR, 34, 2, 15", r"as many nodes, and lines an interval, got 4 and 1"),
        ("*NFILL, NSET=BOTTOM", "*NFILL, BIAS=2.", r"\*NFILL: the parameter BIAS is not read: NSET can be"),
        ("1, 3, 1, 1, 2", "7, 3, 1, 1, 2", r"\*ELGEN: element 7 is not there"),
        ("1, 3, 1, 1, 2", "1, 0, 1, 1, 2", r"needs one element in a row at least, got 0"),
        ("1, 3, 1, 1, 2", ", 3, 1, 1, 2", r"needs 10 whole numbers"),
    ],
)
def test_what_cannot_be_generated_is_refused(tmp_path: Path, given: str, other: str, words: str) -> None:
    text = BLOCKS + STEEL + SECTION + HELD + step("")
    assert text.count(given) == 1
    with pytest.raises(DeckError, match=words):
        read_deck(deck(tmp_path, text.replace(given, other)))


def pulled(folder: Path, load: str, more: str = "") -> np.ndarray:
    """Displacements of a bar of length 3, held at its end and along two of its sides."""
    text = LONG_BAR.replace("0.3", "0.") + FREE_TO_CONTRACT + f"*SURFACE, NAME=END\n6, S4\n5, S4\n{more}"
    (state,) = read_deck(deck(folder, text + step(load))).solve(MPI.COMM_SELF, tolerance=1e-11)
    return state.gather_displacement("BAR")


def test_tractions_pull_along_their_direction_or_along_the_surface(tmp_path: Path) -> None:
    """σ = 100 over E = 210 000 and a length of 3; ends are 1 wide."""
    along = pulled(tmp_path, "*DSLOAD, CONSTANT RESULTANT=YES\nEND, TRVEC, 100., 2., 0., 0.\n")
    assert along[:, 0].max() == pytest.approx(300.0 / 210000.0, rel=1e-9)
    oblique = pulled(tmp_path, "*DSLOAD\nEND, TRSHR, 100., 5., 1., 0.\n")
    across = pulled(tmp_path, "*DSLOAD\nEND, TRVEC, 100., 0., 3., 0.\n")
    assert np.abs(across[:, 1]).max() > 1e-4
    np.testing.assert_allclose(oblique, across, atol=1e-9 * np.abs(across).max())


@pytest.mark.parametrize(
    ("load", "words"),
    [
        ("END, TRVEC, 100.", r"loaded by P and a pressure, or by TRVEC or TRSHR, .* got 'TRVEC, 100.'"),
        ("END, TRSHR, 100., 1., 0., 0.", r"TRSHR needs a plane surface, and a direction not across it"),
        ("ALL, TRSHR, 100., 1., 0., 0.", r"TRSHR needs a plane surface"),
    ],
)
def test_tractions_without_a_direction_are_refused(tmp_path: Path, load: str, words: str) -> None:
    with pytest.raises(DeckError, match=words):
        pulled(tmp_path, f"*DSLOAD\n{load}\n", "*SURFACE, NAME=ALL\n6, S4\n6, S2\n")


def test_tractions_that_turn_with_their_surface_are_refused(tmp_path: Path) -> None:
    text = LONG_BAR + FREE_TO_CONTRACT + "*SURFACE, NAME=END\n6, S4\n"
    load = "*DSLOAD{}\nEND, TRVEC, 100., 1., 0., 0.\n"
    with pytest.raises(DeckError, match=r"a traction that turns .* is not read: give FOLLOWER=NO"):
        read_deck(deck(tmp_path, text + step(load.format(""), ", NLGEOM")))
    read_deck(deck(tmp_path, text + step(load.format(", FOLLOWER=NO"), ", NLGEOM")))


def test_elements_without_a_face_are_all_that_no_other_element_shares(tmp_path: Path) -> None:
    """A pressure of 10 all around, of an incompressible body; here σ = −10 in all directions."""
    text = LONG_BAR + FREE_TO_CONTRACT + "*SURFACE, NAME=SKIN\nBAR,\n"
    found = read_deck(deck(tmp_path, text + step("*DSLOAD\nSKIN, P, 10.\n")))
    assert len(found.scene.bodies["BAR"].mesh.surfaces["SKIN"]) == 22
    (state,) = found.solve(MPI.COMM_SELF, tolerance=1e-11)
    assert state.gather_displacement("BAR")[:, 0].min() == pytest.approx(-30.0 * 0.4 / 210000.0, rel=1e-9)


def test_an_equation_of_two_sets_is_one_for_each_pair_of_nodes(tmp_path: Path) -> None:
    """The sides stay as far apart as they are: plane strain, 1 − ν² of the length."""
    model = LONG_BAR + FREE_TO_CONTRACT + "*SURFACE, NAME=END\n6, S4\n5, S4\n"
    equations = "*EQUATION\n2\nBAR_Y0, 2, 1., BAR_Y1, 2, -1.\n"
    text = model + equations + step("*DSLOAD\nEND, P, -100.\n")
    (state,) = read_deck(deck(tmp_path, text)).solve(MPI.COMM_SELF, tolerance=1e-11)
    longer = state.gather_displacement("BAR")[:, 0].max()
    assert longer == pytest.approx(300.0 * (1 - 0.3**2) / 210000.0, rel=1e-9)
