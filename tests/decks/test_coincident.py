"""Faces of two bodies that coincide, both in the slave and in the master, as FreeCAD writes them."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest
from mpi4py import MPI

from fenics_contact.decks import DeckError, read_deck
from fenics_contact.gallery import block
from tests.decks.texts import STEEL, deck, law, mesh_cards, pressed

#: Faces of both blocks in both surfaces; in the second one those of the lower block come first.
BOTH = "*SURFACE, NAME=DEP\nUP, S1\nLOW, S2\n*SURFACE, NAME=IND\nLOW, S2\nUP, S1\n"
BETWEEN = "*CONTACT PAIR, INTERACTION=DRY, TYPE=SURFACE TO SURFACE\nDEP, IND\n"


def test_contact_is_between_the_bodies_once(tmp_path: Path) -> None:
    found = read_deck(deck(tmp_path, pressed(law("HARD") + BOTH + BETWEEN)))
    (pair,) = found.scene.contacts
    assert {pair.slave.body, pair.master_surface.body} == {"LOW", "UP"}
    assert pair.slave.name != pair.master_surface.name
    assert any("DEP and IND both have faces of the same bodies, which coincide" in n for n in found.notes)
    (state,) = found.solve(MPI.COMM_SELF, tolerance=1e-10)
    assert -state.gather_displacement("UP")[:, 2].min() == pytest.approx(42.0 * 2 / 210000.0, rel=1e-6)
    assert state.contact.normal_force.sum() == pytest.approx(168.0)


def test_ties_are_between_the_bodies_once(tmp_path: Path) -> None:
    found = read_deck(deck(tmp_path, pressed(BOTH + "*TIE, NAME=T\nDEP, IND\n")))
    (tie,) = found.scene.ties
    assert {tie.slave.body, tie.master.body} == {"LOW", "UP"}
    (state,) = found.solve(MPI.COMM_SELF, tolerance=1e-10)
    assert -state.gather_displacement("UP")[:, 2].min() == pytest.approx(42.0 * 2 / 210000.0, rel=1e-6)


def test_the_whole_face_is_the_slave_not_those_that_lie_in_it(tmp_path: Path) -> None:
    """Of the lower block only the cells in the middle lie wholly within the face of the upper one."""
    meshes = {
        "LOW": block((0, 0, 0), (4, 4, 1), (4, 4, 1)),
        "UP": block((0.75, 0.75, 1), (3.25, 3.25, 2), (1, 1, 1)),
    }
    inner = "".join(f"{number}, S2\n" for number in (6, 7, 10, 11))
    text = (
        mesh_cards(meshes) + STEEL + "*SOLID SECTION, ELSET=LOW, MATERIAL=STEEL\n"
        "*SOLID SECTION, ELSET=UP, MATERIAL=STEEL\n*BOUNDARY\nLOW_Z0, 1, 3\nUP_Z1, 1, 2\n"
        f"*SURFACE, NAME=DEP\nUP, S1\n{inner}*SURFACE, NAME=IND\nUP, S1\nLOW, S2\n"
        + law("HARD") + BETWEEN + "*STEP\n*STATIC\n*DLOAD\nUP, P2, 42.\n*END STEP\n"
    )  # fmt: skip
    (pair,) = read_deck(deck(tmp_path, text)).scene.contacts
    assert (pair.slave.body, pair.slave.name) == ("UP", "DEP")
    assert pair.master_surface.name == "IND"
    other = read_deck(deck(tmp_path, text.replace("DEP, IND", "IND, DEP")))
    (pair,) = other.scene.contacts
    assert (pair.slave.body, pair.slave.name) == ("LOW", "IND")
    (state,) = other.solve(MPI.COMM_SELF)
    assert np.isclose(state.contact.normal_force.sum(), 42.0 * 2.5**2, rtol=1e-3)


def test_a_body_alone_is_still_refused(tmp_path: Path) -> None:
    alone = "*SURFACE, NAME=DEP\nLOW, S2\n*SURFACE, NAME=IND\nLOW, S2\n"
    with pytest.raises(DeckError, match="contact of body 'LOW' with itself needs"):
        read_deck(deck(tmp_path, pressed(law("HARD") + alone + BETWEEN)))
