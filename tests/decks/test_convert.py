"""A deck that is written as a scene file has the same answer."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest
from mpi4py import MPI

from fenics_contact import read_scene_file
from fenics_contact.__main__ import main
from fenics_contact.decks import read_deck, write_scene_file
from fenics_contact.errors import InvalidInputError
from fenics_contact.gallery import block, rectangle
from fenics_contact.mesh import quadratic
from tests.decks.texts import (
    BAR,
    BLOCKS,
    END,
    FIXED,
    FREE_TO_CONTRACT,
    KINEMATIC,
    PAIR,
    PLAIN_BAR,
    PULLED,
    REFERENCE,
    RIGID,
    SECTION,
    SPREAD,
    STEEL,
    deck,
    law,
    mesh_cards,
    pressed,
    step,
)

BOLT = (
    "*NODE\n900, 0., 0., 0.\n*SURFACE, NAME=CUT\n2, S4\n"
    "*PRE-TENSION SECTION, SURFACE=CUT, NODE=900\n1., 0., 0.\n"
)
RING = mesh_cards({"BAR": rectangle((5.0, 0.0), (6.0, 2.0), (2, 2))}, "CAX4") + STEEL
RING += "*DENSITY\n1.E-9\n" + SECTION + "*BOUNDARY\nBAR_Y0, 2\n"
FINE = mesh_cards({"BAR": quadratic(block((0, 0, 0), (3, 1, 1), (2, 1, 1)))}) + STEEL + SECTION
TWO = (
    "*MATERIAL, NAME=TIN\n*ELASTIC\n9000., 0.1\n"
    "*ELSET, ELSET=LEFT\n1, 2\n*ELSET, ELSET=RIGHT, GENERATE\n3, 6\n"
    "*SOLID SECTION, ELSET=LEFT, MATERIAL=TIN\n*SOLID SECTION, ELSET=RIGHT, MATERIAL=STEEL\n"
)
DRIVEN = PLAIN_BAR + REFERENCE
RUBBED = pressed(law("LINEAR\n1.E6", "0.3, 1.E5") + PAIR).replace("UP_X0, 1\n", "UP_Z1, 1\n")
TURNED = "*TRANSFORM, NSET=BAR_X1, TYPE=R\n1., 1., 0., 0., 1., 0.\n*BOUNDARY\nBAR_X0, 1, 3\n"
DECKS = {
    "pressure, weight, single nodes": BAR.replace("*ELASTIC", "*DENSITY\n1.E-6\n*ELASTIC")
    + END
    + "*BOUNDARY\n1, 1, 3\n2, 1, 2\n3, 1\n4, 1\n"
    + step(PULLED + "BAR, GRAV, 9.81, 0., 0., -1.\n*CLOAD\n24, 2, 3.\n"),
    "several materials": BAR.replace(SECTION, TWO) + FREE_TO_CONTRACT + END + step(PULLED),
    "temperatures by nodes": BAR.replace("0.3\n", "0.3\n*EXPANSION\n1.E-4\n", 1)
    + "*BOUNDARY\nBAR_X0, 1, 3\n"
    + step("*TEMPERATURE\nBAR_X1, 30.\n"),
    "a ring that turns": RING + step("*DLOAD\nBAR, CENTRIF, 1.E6, 0., 0., 0., 0., 1., 0.\n"),
    "elements without centres": FINE + "*BOUNDARY\nBAR_X0, 1, 3\n" + step("*CLOAD\nBAR_X1, 2, 1.\n"),
    "contact with friction in steps": RUBBED
    + step("*BOUNDARY\nUP_Z1, 1, 1, 0.01\n")
    + step("*DLOAD\nUP, P2, 60.\n*CLOAD\n19, 2, 2.\n"),
    "a tie": BLOCKS + "*TIE, NAME=GLUE\nFEET, TABLE\n" + step("*DLOAD\nUP, P2, -42.\n"),
    "a clearance": pressed(law("HARD") + PAIR + "*CLEARANCE, SLAVE=FEET, MASTER=TABLE, VALUE=1.E-3\n"),
    "a rigid surface": DRIVEN + RIGID + FIXED + step("*BOUNDARY\n501, 1, 1, 0.004\n*CLOAD\n502, 1, 7.\n"),
    "a coupling in steps": DRIVEN
    + KINEMATIC
    + FIXED
    + step("*BOUNDARY\n501, 1, 1, 0.004\n")
    + step("*BOUNDARY\n501, 1, 1, 0.002\n"),
    "a force that is spread": DRIVEN + SPREAD + FIXED + step("*CLOAD\n501, 2, 3.\n501, 4, 7.\n"),
    "a bolt in steps": PLAIN_BAR
    + BOLT
    + FIXED
    + "BAR_X1, 1, 3\n"
    + step("*CLOAD\n900, 1, 420.\n")
    + step("*BOUNDARY, FIXED\n900, 1, 1\n*BOUNDARY\nBAR_X1, 1, 1, 0.004\n"),
    "equations in steps": DRIVEN
    + FIXED
    + "*EQUATION\n2\n18, 3, 1., 20, 3, -1.\n3\n17, 1, 1., 18, 2, 3., 501, 1, -1.\n"
    + step("*CLOAD\n17, 2, 5.\n*BOUNDARY\n501, 1, 1, 0.01\n")
    + step("*BOUNDARY\n501, 1, 1, -0.02\n"),
    "an equation": PLAIN_BAR + FIXED + "*EQUATION\n2\n18, 3, 1., 20, 3, -1.\n" + step("*CLOAD\n17, 2, 5.\n"),
    "axes of nodes": BAR + TURNED + step("*BOUNDARY\nBAR_X1, 1, 1, 0.01\n"),
}


@pytest.mark.parametrize("name", DECKS)
def test_a_scene_file_has_the_answer_of_its_deck(name: str, tmp_path: Path) -> None:
    read = read_deck(deck(tmp_path, DECKS[name]))
    exact = read.solve(MPI.COMM_SELF, tolerance=1e-9)[-1]
    (tmp_path / "there").mkdir()
    files = write_scene_file(read, tmp_path / "there" / "scene.toml")
    assert all(file.exists() for file in files)
    found = read_scene_file(files[0], MPI.COMM_SELF, overrides=["solver.tolerance=1e-9"]).solve()
    assert list(found.scene.bodies) == list(exact.scene.bodies)
    for body in exact.scene.bodies:
        there = exact.gather_displacement(body)
        assert np.abs(there).max() > 1e-9
        np.testing.assert_allclose(found.gather_displacement(body), there, atol=1e-6 * np.abs(there).max())


def test_the_command_line_writes_a_scene_file(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    path = deck(tmp_path, DECKS["a tie"])
    assert main(["convert", str(path)]) == 0
    assert "model.inp as a scene file in" in capsys.readouterr().out
    assert (tmp_path / "model.toml").read_text().startswith("# Written from model.inp\n")
    text = (tmp_path / "model_mesh.inp").read_text()
    assert "*SURFACE, NAME=FEET, TYPE=ELEMENT" in text
    assert main(["run", str(tmp_path / "model.toml"), "--plan"]) == 0


def test_a_deck_without_steps_is_the_scene_before_them(tmp_path: Path) -> None:
    files = write_scene_file(read_deck(deck(tmp_path, BAR + FIXED)), tmp_path / "scene.toml")
    scene = read_scene_file(files[0], MPI.COMM_SELF).scene
    assert [(each.surface, each.value) for each in scene.supports] == [("BAR_X0", (0.0, 0.0, 0.0))]
    assert not scene.loads


def test_what_a_scene_file_cannot_say_is_refused(tmp_path: Path) -> None:
    ring = "*TRANSFORM, NSET=BAR_X1, TYPE=C\n0., 0., 0., 0., 0., 1.\n*BOUNDARY\nBAR_X0, 1, 3\n"
    turned = step("*CLOAD\n502, 1, 7.\n") + step("*CLOAD\n502, 1, 9.\n")
    released = step("*BOUNDARY\nBAR_X1, 1\n") + step("*BOUNDARY, OP=NEW\nBAR_X0, 1, 3\n")
    for text, message in (
        (BAR + ring + step("*BOUNDARY\nBAR_X1, 1, 1, 0.01\n"), "no directions that differ from node to node"),
        (DRIVEN + RIGID + FIXED + turned, "one force on a rigid surface for all steps"),
        (BAR + FIXED + released, "the same components held in all steps, step 2 changes them"),
    ):
        with pytest.raises(InvalidInputError, match=message):
            write_scene_file(read_deck(deck(tmp_path, text)), tmp_path / "scene.toml")
    with pytest.raises(InvalidInputError, match=r"a scene file must end in .toml, got"):
        write_scene_file(read_deck(deck(tmp_path, DECKS["a tie"])), tmp_path / "scene.txt")


def test_a_mesh_that_is_a_deck_has_no_other_keys(tmp_path: Path) -> None:
    files = write_scene_file(read_deck(deck(tmp_path, DECKS["a tie"])), tmp_path / "scene.toml")
    files[0].write_text(files[0].read_text().replace("deck = true", 'deck = true\nsurfaces = ["FEET"]'))
    with pytest.raises(InvalidInputError, match="a mesh with deck = true has bodies and surfaces of"):
        read_scene_file(files[0], MPI.COMM_SELF).scene
