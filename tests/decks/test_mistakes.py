"""What is wrong in a deck is refused with its card and line."""

from __future__ import annotations

from pathlib import Path

import pytest

from fenics_contact.__main__ import main
from fenics_contact.decks import DeckError, read_deck
from fenics_contact.errors import InvalidInputError
from fenics_contact.gallery import block
from tests.decks.texts import STEEL, deck, mesh_cards

MESH = mesh_cards({"BAR": block((0, 0, 0), (2, 1, 1), (2, 1, 1))})
GOOD = (
    MESH + STEEL + "*SOLID SECTION, ELSET=BAR, MATERIAL=STEEL\n*BOUNDARY\nBAR_X0, 1, 3\n"
    "*STEP\n*STATIC\n0.1, 1.\n*CLOAD\nBAR_X1, 1, 10.\n*END STEP\n"
)

#: What is changed, into what, and what the message says, with the text of the line that it must name.
WRONG = [
    ("*STATIC", "*FREQUENCY\n10", "FREQUENCY", r"\*FREQUENCY: only \*STATIC is solved: leave"),
    ("*STATIC", "*FANCY CARD\n*STATIC", "FANCY", r"\*FANCY CARD: this card is not known: the guide lists"),
    ("BAR_X1, 1, 10.", "BAR_X9, 1, 10.", "BAR_X9", r"node set 'BAR_X9' is not there; did you mean BAR_X\d\?"),
    ("BAR_X1, 1, 10.", "99, 1, 10.", "99, 1", r"\*CLOAD: node 99 is not there: correct the number"),
    ("TYPE=C3D8", "TYPE=S9R5", "TYPE=S9R5", r"elements of type S9R5, shells, are not supported: give solids"),
    ("TYPE=C3D8,", "", "*ELEMENT", r"\*ELEMENT: needs the parameter TYPE=, got ELSET=BAR: add it"),
    (
        "1, 1, 5, 7, 3, 2, 6, 8, 4",
        "1, 5, 1, 3, 7, 2, 6, 8, 4",
        "1, 5, 1, 3",
        r"positive Jacobian at .*, 1 of 2 .* C3D8 are inverted or flat: 1;",
    ),
    (
        "1, 1, 5, 7, 3, 2, 6, 8, 4",
        "1, 1, 5, 7, 3, 2, 6, 8",
        "1, 1, 5, 7, 3, 2, 6, 8\n",
        r"needs 9 numbers for each element",
    ),
    (
        "1, 1, 5, 7, 3, 2, 6, 8, 4",
        "1, 1, 5, x, 3, 2, 6, 8, 4",
        "1, 1, 5, x",
        r"must list whole numbers, got '1, 1, 5, x",
    ),
    (
        "2, 5, 9, 11, 7, 6, 10, 12, 8",
        "1, 5, 9, 11, 7, 6, 10, 12, 8",
        "*ELEMENT",
        r"element 1 is there already",
    ),
    (
        "ELSET=BAR, MATERIAL",
        "ELSET=BAZ, MATERIAL",
        "ELSET=BAZ",
        r"element set 'BAZ' is not there; did you mean BAR\?",
    ),
    (
        "MATERIAL=STEEL\n*B",
        "MATERIAL=TIN\n*B",
        "MATERIAL=TIN",
        r"material 'TIN' is not there; the deck has STEEL",
    ),
    (
        "*SOLID SECTION, ELSET=BAR",
        "*ELSET, ELSET=HALF\n1\n*SOLID SECTION, ELSET=HALF",
        "*ELEMENT",
        r"element 2 and 0 others have no \*SOLID SECTION",
    ),
    ("210000., 0.3", "210000., 0.6", "*MATERIAL", r"poisson_ratio must"),
    ("210000., 0.3", "210000., y", "210000., y", r"entry 2 must be a number, got 'y'"),
    ("*ELASTIC", "*ELASTIC, TYPE=HYPO", "*ELASTIC", r"TYPE=HYPO is not read: give ISO"),
    ("*ELASTIC", "*USER MATERIAL\n1.\n*ELASTIC", "*USER", r"materials of user routines are not read"),
    (
        "*CLOAD\nBAR_X1, 1, 10.",
        "*DLOAD\nBAR, P7, 1.",
        "P7",
        r"C3D8 has 6 faces, got 'P7'",
    ),
    ("*CLOAD\nBAR_X1, 1, 10.", "*DLOAD\nBAR, P4, 1.", "P4", r"a face of element 1 lies between two elements"),
    (
        "*CLOAD\nBAR_X1, 1, 10.",
        "*DLOAD\nBAR, GRAV, 1., 0., 0., 1.",
        "GRAV",
        r"GRAV needs a \*DENSITY of material STEEL",
    ),
    ("*CLOAD\nBAR_X1, 1, 10.", "*DLOAD\nBAR, BX, 1.", "BAR, BX", r"load 'BX' is not supported: give P1, P2"),
    (
        "*CLOAD\nBAR_X1, 1, 10.",
        "*DSLOAD\nTOP, P, 1.",
        "TOP, P",
        r"surface 'TOP' is not there; the deck has none",
    ),
    (
        "*CLOAD\nBAR_X1, 1, 10.",
        "*CLOAD, AMPLITUDE=UP\nBAR_X1, 1, 10.",
        "*CLOAD",
        r"amplitude 'UP' is not there; the deck has none",
    ),
    ("BAR_X1, 1, 10.", "BAR_X1, 1", "BAR_X1, 1\n", r"needs node or set, component and force"),
    ("*STEP", "*STEP, PERTURBATION", "*STEP", r"PERTURBATION is not supported"),
    ("*END STEP", "", "*STEP", r"has no \*END STEP: add it"),
    ("*STATIC\n0.1, 1.\n", "", "*STEP", r"needs \*STATIC: nothing else is solved here"),
    ("*STEP\n", "*CLOAD\nBAR_X1, 1, 1.\n*STEP\n", "*CLOAD", r"must be between \*STEP and \*END STEP"),
    (
        "*STEP\n",
        "*NSET, NSET=ODD, GENERATE\n9, 1, 2\n*STEP\n",
        "9, 1, 2",
        r"GENERATE needs first ≤ last",
    ),
    (
        "*STEP\n",
        "*SURFACE, NAME=TOP\nBAR, 3\n*STEP\n",
        "BAR, 3",
        r"needs a face S1, S2, ... behind the elements, got '3'",
    ),
    (
        "*STEP\n",
        "*INCLUDE, INPUT=more.inp\n*STEP\n",
        "*INCLUDE",
        r"there must be an included file '.*more.inp', there is none",
    ),
    ("*STEP\n", "*INCLUDE, INPUT=model.inp\n*STEP\n", "*INCLUDE", r"file 'model.inp' includes itself"),
    ("BAR_X0, 1, 3", "BAR_X0, 11, 11, 5.", "BAR_X0, 11", r"rotations, 4 to 6, got 11"),
    ("*ELASTIC", "*HYPERELASTIC, YEOH\n1., 0.\n*ELASTIC", "*HYPER", r"needs NLGEOM in its \*STEP"),
    (
        "*STEP\n",
        "*AMPLITUDE, NAME=A\n0., 0., 1.\n*STEP\n",
        "*AMPLITUDE",
        r"needs pairs of a time and a value, got 3 numbers",
    ),
    ("BAR_X0, 1, 3", "BAR_X0, 3, 1", "BAR_X0, 3, 1", r"must not be above the last, got 3 and 1"),
    ("BAR_X0, 1, 3", "1, 3, 1", "1, 3, 1", r"must not be above the last, got 3 and 1"),
    ("BAR_X0, 1, 3", "1.5, 1, 3", "1.5, 1, 3", r"must be whole and at most 2147483647, got 1.5"),
    (
        "*STEP\n",
        "*ELEMENT, TYPE=C3D8\n*STEP\n",
        "*ELEMENT, TYPE=C3D8\n*STEP",
        r"needs elements, it has no data",
    ),
    ("*STEP\n", "*NODE, NSET=X\n*STEP\n", "*NODE, NSET=X", r"needs nodes, it has no data lines"),
    (
        "*STEP\n",
        "*NSET, NSET=X\n99999999999999999999\n*STEP\n",
        "*NSET, NSET=X",
        r"node 9223372036854775807 is not there",
    ),
    ("12, 2, 1, 1", "12, 2, 1, 1e200", "12, 2, 1, 1e200", r"entry 4 must be finite and below 1e\+60"),
    ("BAR_X1, 1, 10.", "BAR_X1, 1, nan", "BAR_X1, 1, nan", r"must be finite and below 1e\+60, got 'nan'"),
    ("*STEP\n", "*EQUATION\n0\n*STEP\n", "0\n*STEP", r"needs the number of its terms, got '0'"),
    (
        "*STEP\n",
        "*EQUATION\n2\n1, x, 1., 2, 3, -1.\n*STEP\n",
        "1, x, 1.",
        r"an entry must be a number, got 'x'",
    ),
    (
        "*STEP\n",
        "*EQUATION\n2\n1, 9, 1., 2, 3, -1.\n*STEP\n",
        "1, 9, 1.",
        r"components must be from 1 to 6",
    ),
    (
        "*ELASTIC\n210000., 0.3",
        "*ELASTIC, TYPE=ORTHO\n0., 0., 0., 0., 0., 1000., 0., 300.,\n300.",
        "*ELASTIC",
        r"stiffnesses must be positive definite, got the smallest eigenvalue 0",
    ),
    ("*CLOAD\n", "*CLOAD, LOAD CASE=2\n", "*CLOAD", r"the parameter LOADCASE is not read: AMPLITUDE, NAME"),
    ("*CLOAD\n", "*CLOAD, TIME DELAY=1.\n", "*CLOAD", r"TIME DELAY needs an AMPLITUDE"),
    (
        "BAR_X0, 1, 3",
        "BAR_X0, 1, 3\n*BOUNDARY, TYPE=VELOCITY\n1, 1",
        "*BOUNDARY, T",
        r"TYPE=VELOCITY is not read",
    ),
]


@pytest.mark.parametrize(("old", "new", "line", "message"), WRONG, ids=[w[3][:30] for w in WRONG])
def test_a_mistake_is_refused_at_its_line(
    old: str, new: str, line: str, message: str, tmp_path: Path
) -> None:
    assert old in GOOD
    text = GOOD.replace(old, new, 1)
    with pytest.raises(DeckError, match=message) as caught:
        read_deck(deck(tmp_path, text))
    place = text.rindex(line) if line.startswith("*STEP\n*STATIC\n*B") else text.index(line)
    assert caught.value.line == text.count("\n", 0, place) + 1
    assert str(caught.value).startswith(f"model.inp, line {caught.value.line}: *")


def test_a_deck_without_nodes_elements_or_cards_is_refused(tmp_path: Path) -> None:
    for text, message in (
        ("x = 1\n", "a deck must have cards such as"),
        ("1, 2\n*NODE\n1, 0., 0.\n", "data must follow a card, got '1, 2'"),
        ("*HEADING\n", "a deck must have nodes"),
        ("*NODE\n1, 0., 0.\n", "a deck must have elements"),
    ):
        with pytest.raises(DeckError, match=message):
            read_deck(deck(tmp_path, text))
    with pytest.raises(InvalidInputError, match=r"there must be a deck .*none.inp"):
        read_deck(tmp_path / "none.inp")


def test_a_deck_is_read_whatever_its_spelling(tmp_path: Path) -> None:
    """Includes, continued lines, comments, blanks, small letters and Fortran's exponents."""
    head, cut, rest = GOOD.partition("*MATERIAL")
    (tmp_path / "mesh.inp").write_text("** nodes and elements\n" + head.lower().replace(", ", " ,  "))
    odd = cut + rest.replace("210000., 0.3", "  2.1D5 , .3,").replace("*SOLID SECTION", "*Solid section")
    odd = odd.replace("MATERIAL=STEEL\n*B", "\nmaterial = steel\n*B").replace("10.\n", "10.,\n** end\n\n")
    plain, spelt = (
        read_deck(deck(tmp_path, text, name))
        for text, name in ((GOOD, "model.inp"), ("*include, input=mesh.inp\n" + odd, "odd.inp"))
    )
    assert list(spelt.scene.bodies) == ["BAR"]
    assert spelt.scene.bodies["BAR"].material == plain.scene.bodies["BAR"].material
    assert spelt.steps[0].loads == plain.steps[0].loads
    assert spelt.scene.bodies["BAR"].mesh.volume == plain.scene.bodies["BAR"].mesh.volume


def test_the_command_line_runs_a_deck(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    path, output = deck(tmp_path, "*HEADING\na bar\n*CONTROLS\n1\n" + GOOD), tmp_path / "there"

    def run(*more: str) -> int:
        return main(["run", str(path), "-o", str(output), "--no-pictures", *more])

    assert run("--plan") == 0
    printed = capsys.readouterr().out
    assert "! *CONTROLS, model.inp line 3: has no effect here" in " ".join(printed.split())
    assert not output.exists()
    assert run("--set", "output.files=['csv']") == 0
    printed = capsys.readouterr().out
    assert (output / "result.json").exists()
    assert ["reaction", "0", "BAR", "BAR_X0", "-40"] in [line.split()[:5] for line in printed.splitlines()]
    assert run("--set", "loads=[]") == 2
    assert "--set changes solver, accuracy, output, units and title of a deck" in capsys.readouterr().err
    path.write_text(GOOD.replace("*STATIC", "*FANCY"))
    assert run() == 2
    assert "model.inp, line" in capsys.readouterr().err


def test_all_that_is_not_known_is_named_at_once(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    """Cards, types of elements and parameters, each once with its line, and what structures are."""
    more = "*ELEMENT, TYPE=S9R5\n8, 1, 2, 3, 4\n*SHELL GENERAL SECTION, ELSET=X\n1.\n*DASHPOT, ELSET=Y\n"
    more += "*FANCY\n*FANCY\n"
    text = GOOD.replace("*STEP\n", more + "*STEP\n").replace("*CLOAD\n", "*CLOAD, LOAD CASE=2\n")
    path = deck(tmp_path, text)
    assert main(["run", str(path), "--plan"]) == 2
    words = capsys.readouterr().err
    lines = path.read_text().splitlines()
    first = 1 + lines.index("*ELEMENT, TYPE=S9R5")
    assert f"line {first}: *ELEMENT: elements of type S9R5, shells, are not supported" in words
    for card, what in (
        ("*SHELL GENERAL SECTION, ELSET=X", "shells of given stiffness are not solved here"),
        ("*DASHPOT, ELSET=Y", "dashpots are not solved here"),
        ("*FANCY", "this card is not known: the guide lists those that are"),
        ("*CLOAD, LOAD CASE=2", "the parameter LOADCASE is not read"),
    ):
        name = card.partition(",")[0]
        assert f"{name} (line {1 + lines.index(card)} of model.inp): {what}" in words
    assert words.count("*FANCY") == 1
