"""Steps of decks that change contact: *CHANGE FRICTION, *CHANGE SURFACE BEHAVIOR, *MODEL CHANGE."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest
from mpi4py import MPI

from fenics_contact import Coulomb, LinearClosure
from fenics_contact.decks import DeckError, read_deck, write_scene_file
from fenics_contact.errors import InvalidInputError
from tests.decks.texts import BLOCKS, PAIR, deck, law, pressed, step

WEIGHT = 42.0 * 4.0


def dragged(way: float, change: str = "") -> str:
    return step(f"{change}*BOUNDARY\nUP_Z1, 1, 1, {way}\n")


def test_friction_changes_from_step_to_step_and_pairs_go_and_come_back(tmp_path: Path) -> None:
    text = BLOCKS + "UP_Y0, 2\n" + law("HARD", "0.3") + PAIR
    change = "*CHANGE FRICTION, INTERACTION=DRY\n*FRICTION\n{}\n"
    switch = "*MODEL CHANGE, TYPE=CONTACT PAIR, {}\nFEET, TABLE\n"
    text += step("*DLOAD\nUP, P2, 42.\n*BOUNDARY\nUP_Z1, 1, 1, 0.01\n")
    text += dragged(0.02, change.format(0.1)) + dragged(0.02, change.format(0.5)) + dragged(0.03)
    text += step(switch.format("REMOVE") + "*BOUNDARY, FIXED\nUP_Z1, 3\n") + step(switch.format("ADD"))
    found = read_deck(deck(tmp_path, text))
    (pair,) = found.scene.contacts
    assert pair.friction == Coulomb(0.3)
    given = [None if each.contacts is None else [c.friction for c in each.contacts] for each in found.steps]
    assert given == [None, [Coulomb(0.1)], [Coulomb(0.5)], None, [], [Coulomb(0.5)]]
    states = found.solve(MPI.COMM_SELF, tolerance=1e-10)
    forces = np.array([state.reactions()["UP UP_Z1"].force for state in states])
    shares = [0.3, 0.1, 0.1, 0.5, 0.0]  # more friction alone moves nothing
    np.testing.assert_allclose(forces[:5, 0], WEIGHT * np.array(shares), atol=1e-6 * WEIGHT)
    np.testing.assert_allclose(forces[:5, 2], [*[0.0] * 4, WEIGHT], atol=1e-6 * WEIGHT)
    counts = [len(state.contact.force) for state in states]
    assert counts == [9, 9, 9, 9, 0, 9]


def test_another_closure_holds_from_its_step_on(tmp_path: Path) -> None:
    change = (
        "*CHANGE SURFACE BEHAVIOR, INTERACTION=DRY\n*SURFACE BEHAVIOR, PRESSURE-OVERCLOSURE=LINEAR\n1.E5\n"
    )
    found = read_deck(deck(tmp_path, pressed(law("LINEAR\n1.E6") + PAIR) + step(change)))
    (pair,) = found.steps[1].contacts or ()
    assert pair.closure == LinearClosure(1e5)
    lowered = [
        float(-s.gather_displacement("UP")[:, 2].min()) for s in found.solve(MPI.COMM_SELF, tolerance=1e-10)
    ]
    bodies = 42.0 * 2 / 210000.0
    np.testing.assert_allclose(lowered, [bodies + 42e-6, bodies + 42e-5], rtol=1e-6)
    with pytest.raises(InvalidInputError, match="the same contact pairs in all steps, step 2 changes them"):
        write_scene_file(found, tmp_path / "scene.toml")


@pytest.mark.parametrize(
    ("cards", "message"),
    [
        (
            "*MODEL CHANGE, TYPE=ELEMENT, REMOVE\nUP\n",
            r"needs TYPE=CONTACT PAIR and REMOVE or ADD, got TYPE=ELEM",
        ),
        (
            "*MODEL CHANGE, TYPE=CONTACT PAIR\nFEET, TABLE\n",
            r"needs TYPE=CONTACT PAIR and REMOVE or ADD, got",
        ),
        (
            "*MODEL CHANGE, TYPE=CONTACT PAIR, REMOVE\nFEET, CHAIR\n",
            r"no contact pair of these surfaces; the deck has FEET, TABLE",
        ),
        (
            "*CHANGE FRICTION, INTERACTION=WET\n*FRICTION\n0.1\n",
            r"interaction 'WET' is not there; .* has DRY",
        ),
        ("*CHANGE FRICTION\n*FRICTION\n0.1\n", r"needs the parameter INTERACTION="),
        ("*FRICTION\n0.1\n", r"must follow \*CHANGE FRICTION within a step"),
        (
            "*CHANGE SURFACE BEHAVIOR, INTERACTION=DRY\n*SURFACE BEHAVIOR, PRESSURE-OVERCLOSURE=TIED\n",
            r"a step cannot change TIED",
        ),
    ],
    ids=lambda text: text[:30],
)
def test_a_change_that_cannot_be_is_refused(cards: str, message: str, tmp_path: Path) -> None:
    with pytest.raises(DeckError, match=message):
        read_deck(deck(tmp_path, pressed(law("HARD") + PAIR) + step(cards)))


def test_a_change_outside_of_steps_is_refused(tmp_path: Path) -> None:
    change = "*CHANGE FRICTION, INTERACTION=DRY\n*FRICTION\n0.1\n"
    with pytest.raises(DeckError, match=r"must be between \*STEP and \*END STEP: move it there"):
        read_deck(deck(tmp_path, pressed(law("HARD") + PAIR, change)))


def test_slaves_are_adjusted_by_a_set_with_all_of_their_nodes(tmp_path: Path) -> None:
    contact = law("HARD") + PAIR.replace("TYPE", "ADJUST=UP_Z0, TYPE")
    found = read_deck(deck(tmp_path, pressed(contact)))
    assert found.scene.contacts[0].gap == 0.0
    some = "*NSET, NSET=SOME\n19, 20\n" + law("HARD") + PAIR.replace("TYPE", "ADJUST=SOME, TYPE")
    with pytest.raises(DeckError, match=r"ADJUST=SOME lacks .* slave nodes"):
        read_deck(deck(tmp_path, pressed(some)))
