"""Included files are as if their text were in the deck; keywords are read as people write them."""

from __future__ import annotations

from pathlib import Path

import pytest
from mpi4py import MPI

from fenics_contact.decks import DeckError, read_deck
from fenics_contact.gallery import block
from tests.decks.texts import FREE_TO_CONTRACT, SECTION, STEEL, deck, mesh_cards

BAR = mesh_cards({"BAR": block((0, 0, 0), (1, 1, 1), (1, 1, 1))}) + STEEL.replace("0.3", "0.") + SECTION
HEAD = BAR + FREE_TO_CONTRACT + "*STEP\n*STATIC\n*CLOAD\n5, 1, 525.\n"
TAIL = "*NODE PRINT, NSET=BAR_X1\nU\n*END STEP\n"
#: All four nodes of the end: E A = 210000 and 2100 in all make it longer by 0.01.
FIRST, LATER = "6, 1, 525.\n", "7, 1, 525.\n8, 1, 525.\n"
FORCES = FIRST + LATER

#: Where the file is included, and what it has.
FILES = {
    "data alone": (HEAD + "*INCLUDE, INPUT=more.inp\n" + TAIL, FORCES),
    "data, then a card": (HEAD + "*INCLUDE, INPUT=more.inp\n" + TAIL, FORCES + "*DLOAD\n1, P1, 0.\n"),
    "its card and data go on behind it": (
        HEAD + "*DLOAD\n*INCLUDE, INPUT=more.inp\n" + LATER + TAIL,
        "1, P1, 0.\n*CLOAD\n" + FIRST,
    ),
    "data in the midst of a card": (
        HEAD + "*INCLUDE, INPUT=more.inp\n" + LATER + TAIL,
        "** a force\n\n" + FIRST,
    ),
    "nothing": (HEAD + FORCES + "*INCLUDE, INPUT=more.inp\n" + TAIL, ""),
    "comments alone": (HEAD + FORCES + "*INCLUDE, INPUT=more.inp\n" + TAIL, "** none\n"),
    "one file in another": (HEAD + "*INCLUDE, INPUT=again.inp\n" + TAIL, FORCES),
}


@pytest.mark.parametrize("case", FILES)
def test_an_included_file_is_as_if_its_text_were_in_the_deck(tmp_path: Path, case: str) -> None:
    """E A = 210 000 and four forces of 525 on a bar of length 1: it is longer by 0.01."""
    text, more = FILES[case]
    (tmp_path / "more.inp").write_text(more)
    (tmp_path / "again.inp").write_text("*INCLUDE, INPUT=more.inp\n")
    (state,) = read_deck(deck(tmp_path, text)).solve(MPI.COMM_SELF)
    assert state.gather_displacement("BAR")[:, 0].max() == pytest.approx(0.01, rel=1e-9)


def test_what_is_wrong_in_data_of_another_file_is_named_by_that_file(tmp_path: Path) -> None:
    (tmp_path / "more.inp").write_text("** forces\n6, 1, 525.\n9, 1, 525.\n")
    with pytest.raises(DeckError, match=r"^more.inp, line 3: \*CLOAD: node 9 is not there") as found:
        read_deck(deck(tmp_path, HEAD + "*INCLUDE, INPUT=more.inp\n" + TAIL))
    assert found.value.line == 3
    with pytest.raises(DeckError, match=r"more.inp, line 2: data must follow a card, got '6, 1, 525.'"):
        read_deck(deck(tmp_path, "*INCLUDE, INPUT=more.inp\n" + HEAD + TAIL))


#: How keywords are written in the wild.
SPELT = {
    "a comma in front of data": ("*CLOAD\n", "*CLOAD,\n"),
    "a comma in front of names": ("*NODE PRINT, NSET=BAR_X1\nU\n", "*NODE PRINT, NSET=BAR_X1,\nU, RF\n"),
    "a parameter in the next line": ("MATERIAL=STEEL\n", "\n** of\nMATERIAL = STEEL\n"),
    "a flag in the next line": ("*STEP\n", "*STEP, INC=9,\nNLGEOM\n"),
    "a comment behind a comma": ("*CLOAD\n", "*CLOAD, ** the end\n"),
    "a comment behind a name": ("*STATIC\n", "*STATIC ** at last\n"),
    "a title in the line of the heading": ("*NODE\n", "*HEADING a bar, 1 = one\n*NODE\n"),
    "an asterisk alone": ("*STATIC\n", "*STATIC\n*\n"),
    "blanks in front": ("*STATIC\n", "  ** quiet\n  *STATIC\n"),
    "text in front of all cards": ("*NODE\n", ">**\n*NODE\n"),
    "a byte order mark": ("*NODE\n", "\ufeff*NODE\n"),
    "a name of a support": ("*BOUNDARY\n", "*BOUNDARY, NAME=ROOT\n"),
    "a request for messages": ("*STATIC\n", "*PRINT, CONTACT=YES\n*STATIC\n"),
    "a surface without lines that nothing uses": ("*MATERIAL", "*SURFACE, NAME=NONE\n*MATERIAL"),
}


@pytest.mark.parametrize("case", SPELT)
def test_keywords_are_read_as_people_write_them(tmp_path: Path, case: str) -> None:
    old, new = SPELT[case]
    text = HEAD + FORCES + TAIL
    assert old in text
    made = read_deck(deck(tmp_path, text.replace(old, new, 1)))
    plain = read_deck(deck(tmp_path, text))
    assert list(map(repr, made.steps[0].loads)) == list(map(repr, plain.steps[0].loads))
    assert made.scene.supports == plain.scene.supports


def test_data_behind_an_asterisk_alone_belong_to_no_card(tmp_path: Path) -> None:
    """CalculiX warns of each such line and leaves it out."""
    with pytest.raises(DeckError, match=r"line \d+: data cannot follow an asterisk alone: name a card"):
        read_deck(deck(tmp_path, HEAD + "*\n" + FORCES + TAIL))


def test_a_surface_without_lines_is_refused_where_it_is_used(tmp_path: Path) -> None:
    text = HEAD.replace("*STEP", "*SURFACE, NAME=NONE\n*STEP") + "*DSLOAD\nNONE, P, 1.\n" + TAIL
    with pytest.raises(DeckError, match=r"\*DSLOAD: surface 'NONE' has no lines: add its faces or nodes"):
        read_deck(deck(tmp_path, text))
