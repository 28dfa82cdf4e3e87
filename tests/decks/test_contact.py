"""Contact pairs and ties of decks: two blocks, one on the other, as in theory."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest
from mpi4py import MPI

from fenics_contact import ClosureTable, Coulomb, ExponentialClosure, LinearClosure, Tie
from fenics_contact.decks import Deck, DeckError, read_deck
from tests.decks.texts import BLOCKS, PAIR, deck, law, pressed


def lowered(found: Deck) -> float:
    """Return how far the top comes down."""
    (state,) = found.solve(MPI.COMM_SELF, tolerance=1e-10)
    return float(-state.gather_displacement("UP")[:, 2].min())


@pytest.mark.parametrize(
    ("behavior", "closure"),
    [
        ("HARD", 0.0),
        ("LINEAR\n1.E6", 42e-6),
        ("EXPONENTIAL\n1.E-3, 42.", 0.0),
        ("TABULAR\n0., 0.\n84., 2.E-4", 1e-4),
    ],
)
def test_blocks_approach_by_the_law_of_closure(behavior: str, closure: float, tmp_path: Path) -> None:
    found = read_deck(deck(tmp_path, pressed(law(behavior) + PAIR)))
    assert lowered(found) == pytest.approx(42.0 * 2 / 210000.0 + closure, rel=1e-6)
    (pair,) = found.scene.contacts
    assert found.source("contact", pair.place).card == "*CONTACT PAIR"
    kinds = {"H": type(None), "L": LinearClosure, "E": ExponentialClosure, "T": ClosureTable}
    assert type(pair.closure) is kinds[behavior[0]]
    if behavior == "HARD":
        assert any("hard contact is exact" in words for words in found.notes)


def test_nodes_that_make_faces_are_a_slave(tmp_path: Path) -> None:
    contact = law("HARD") + "*CONTACT PAIR, INTERACTION=DRY, TYPE=NODE TO SURFACE\nNODES, TABLE\n"
    found = read_deck(deck(tmp_path, pressed(contact)))
    other = read_deck(deck(tmp_path, pressed(contact.replace("NODE TO", "SURFACE TO")), "other.inp"))
    assert found.scene.contacts == other.scene.contacts  # the scene chooses, whatever TYPE says
    assert lowered(found) == pytest.approx(42.0 * 2 / 210000.0, rel=1e-6)


def test_single_nodes_touch_one_by_one(tmp_path: Path) -> None:
    """Four corners carry 168 N by a soft law, each on a quarter of the three faces around it, of 1 mm²."""
    corners = "*NSET, NSET=LEGS\n19, 23, 31, 35\n*EQUATION\n" + "".join(
        f"2\n{node}, 3, 1., 19, 3, -1.\n" for node in range(21, 36, 2)
    )
    contact = corners + law("LINEAR\n1.E4") + PAIR.replace("FEET", "LEGS")
    found = read_deck(deck(tmp_path, pressed(contact)))
    (pair,) = found.scene.contacts
    assert (pair.nodes, pair.slave.name) == ("LEGS", "LEGS AROUND")
    assert any(
        "the 4 nodes of LEGS are not all nodes of some faces and touch one by one" in n for n in found.notes
    )
    (state,) = found.solve(MPI.COMM_SELF, tolerance=1e-10)
    assert state.contact.points.count == 4
    assert state.contact.normal_force.sum() == pytest.approx(168.0, rel=1e-6)
    np.testing.assert_allclose(state.contact.gap, -state.contact.normal_force / (1e4 * 0.75), rtol=1e-6)


def test_a_clearance_closes_first_and_a_negative_one_presses(tmp_path: Path) -> None:
    clear = "*CLEARANCE, SLAVE=FEET, MASTER=TABLE, VALUE={}\n"
    apart, over = (
        lowered(read_deck(deck(tmp_path, pressed(law("HARD") + PAIR + clear.format(value)))))
        for value in (1e-3, -1e-3)
    )
    assert apart == pytest.approx(42.0 * 2 / 210000.0 + 1e-3, rel=1e-6)
    assert over == pytest.approx(42.0 * 2 / 210000.0 - 1e-3, rel=1e-6)


def test_what_is_adjusted_touches_without_strain(tmp_path: Path) -> None:
    found = read_deck(deck(tmp_path, pressed(law("HARD") + PAIR.replace("TYPE", "ADJUST=0.01, TYPE"))))
    assert found.scene.contacts[0].adjust == 0.01
    assert found.scene.contacts[0].interference is None


@pytest.mark.parametrize("tie", ["*TIE, NAME=GLUE\nFEET, TABLE\n", law("TIED\n1.E8") + PAIR])
def test_tied_blocks_hang_on_each_other(tie: str, tmp_path: Path) -> None:
    found = read_deck(deck(tmp_path, BLOCKS + tie + "*STEP\n*STATIC\n*DLOAD\nUP, P2, -42.\n*END STEP\n"))
    (glue,) = found.scene.ties
    assert isinstance(glue, Tie)
    assert found.source("tie", glue.place).line > 0
    (state,) = found.solve(MPI.COMM_SELF, tolerance=1e-10)
    assert state.gather_displacement("UP")[:, 2].max() == pytest.approx(42.0 * 2 / 210000.0, rel=1e-6)


def test_friction_holds_up_to_its_bound(tmp_path: Path) -> None:
    """Pressed by 168 N a block is pushed; the table takes 0.25 times as much."""
    push = "*DLOAD\nUP, P2, 42.\n*BOUNDARY\nUP_Z1, 1, 1, 0.1\n"
    held = "UP_Z1, 1\nUP_Y0, 2\n"
    text = BLOCKS + held + law("HARD", "0.25") + PAIR + "*STEP\n*STATIC\n" + push + "*END STEP\n"
    found = read_deck(deck(tmp_path, text))
    assert found.scene.contacts[0].friction == Coulomb(0.25)
    (state,) = found.solve(MPI.COMM_SELF, tolerance=1e-8)
    np.testing.assert_allclose(state.reactions()["LOW LOW_Z0"].force[[0, 2]], [-42.0, 168.0], rtol=1e-4)
    sprung = read_deck(deck(tmp_path, text.replace("0.25\n", "0.25, 1.E5\n")))
    assert sprung.scene.contacts[0].friction == Coulomb(0.25, stick_stiffness=1e5)


WRONG = [
    (
        PAIR + "*CLEARANCE, SLAVE=TABLE, MASTER=FEET, VALUE=1.E-3\n",
        "*CLEARANCE",
        r"there is no contact pair of TABLE on FEET",
    ),
    (PAIR.replace("DRY", "WET"), "*CONTACT", r"surface interaction 'WET' is not there; the deck has DRY"),
    (PAIR.replace("TABLE", "CHAIR"), "FEET, CHAIR", r"surface 'CHAIR' is not there"),
    (PAIR.replace("FEET, TABLE", "FEET"), "FEET\n", r"needs a slave and a master surface in each line"),
    (PAIR.replace("SURFACE TO", "EDGE TO"), "*CONTACT", r"TYPE=EDGE TO SURFACE is not read"),
    (
        PAIR.replace("TYPE", "ADJUST=LOW_Z0, TYPE"),
        "*CONTACT",
        r"ADJUST=LOW_Z0 lacks .* slave nodes",
    ),
    (
        "*NSET, NSET=FEW\n1, 2\n" + PAIR.replace("TABLE", "FEW"),
        "FEET, FEW",
        r"the 2 nodes of 'FEW' are not all nodes of some faces",
    ),
    (
        "*SURFACE, NAME=INNER\n1, S4\n" + PAIR.replace("TABLE", "INNER"),
        "FEET, INNER",
        r"a face of element 1 lies between two",
    ),
    (PAIR.replace("FEET", "TABLE"), "TABLE, TABLE", r"contact of body 'LOW' with itself needs"),
    ("*TIE, NAME=T\nTABLE, TABLE\n", "TABLE, TABLE", r"Tie needs two surfaces"),
    ("*TIE, NAME=T, CYCLIC SYMMETRY\nFEET, TABLE\n", "*TIE", r"needs a \*CYCLIC SYMMETRY MODEL with TIE=T"),
]


@pytest.mark.parametrize(("contact", "line", "message"), WRONG, ids=[w[2][:30] for w in WRONG])
def test_a_mistake_in_contact_is_refused_at_its_line(
    contact: str, line: str, message: str, tmp_path: Path
) -> None:
    text = pressed(law("HARD") + contact)
    with pytest.raises(DeckError, match=message) as caught:
        read_deck(deck(tmp_path, text))
    wanted = text.count("\n", 0, text.rindex(line)) + 1
    assert caught.value.line in (wanted, wanted - 1)


@pytest.mark.parametrize(
    ("behavior", "message"),
    [
        ("WAVY", r"PRESSURE-OVERCLOSURE=WAVY with 0 numbers is not read: give HARD"),
        ("HARD\n*FRICTION\n", r"\*FRICTION: needs a friction coefficient"),
    ],
)
def test_a_law_of_surfaces_that_is_not_known_is_refused(behavior: str, message: str, tmp_path: Path) -> None:
    with pytest.raises(DeckError, match=message):
        read_deck(deck(tmp_path, pressed(law(behavior) + PAIR)))
    for card in ("*FRICTION\n0.1\n", "*SURFACE BEHAVIOR\n"):
        with pytest.raises(DeckError, match=r"must follow a \*SURFACE INTERACTION"):
            read_deck(deck(tmp_path, pressed(card)))
