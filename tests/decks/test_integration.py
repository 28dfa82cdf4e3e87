"""Elements with R behind their number have reduced integration; other letters, delays and restarts."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest
from mpi4py import MPI

from fenics_contact._kinematics.integration import FULL
from fenics_contact.decks import DeckError, read_deck
from fenics_contact.gallery import block, rectangle
from fenics_contact.mesh import joined_cells, quadratic, serendipity
from tests.decks.solved import solved
from tests.decks.texts import STEEL, deck, mesh_cards
from tests.fem.columns import COLUMN
from tests.fem.mixed_cells import named_sides

SECTION = "*SOLID SECTION, ELSET=BAR, MATERIAL=STEEL\n"
SOFT = STEEL.replace("210000.", "1000.")
CUBE = block((0, 0, 0), (1, 1, 1), (1, 1, 1))
NOTHING = "*STEP\n*STATIC\n*END STEP\n"


@pytest.mark.filterwarnings("ignore")
@pytest.mark.parametrize(
    ("element", "calculix"),
    [("C3D20", (0.1599523, 0.1913494, -0.1057309)), ("C3D20R", (0.6174659, -0.1591363, -0.3378822))],
)
def test_a_column_bends_as_calculix_has_it(element: str, calculix, tmp_path: Path) -> None:
    text = mesh_cards({"BAR": COLUMN}, element) + SOFT + SECTION + "*BOUNDARY\nBAR_Z0, 1, 3\n"
    tip = "*STEP\n*STATIC\n*CLOAD\nTIP, 1, 1.\nTIP, 2, 2.\nTIP, 3, -3.\n*END STEP\n"
    points = [line.split(", ") for line in text.splitlines() if line.count(", ") == 3 and "=" not in line]
    place = COLUMN.points[COLUMN.node_sets["tip"][0]]
    number = next(row[0] for row in points if np.allclose([float(x) for x in row[1:]], place))
    found = read_deck(deck(tmp_path, text + f"*NSET, NSET=TIP\n{number}\n" + tip))
    body = found.scene.bodies["BAR"]
    assert body.integration == ("reduced" if element.endswith("R") else "full")
    u = found.solve(MPI.COMM_SELF, tolerance=1e-10)[-1].gather_displacement("BAR")
    at_tip = u[np.argmin(np.linalg.norm(body.mesh.points - place, axis=1))]
    np.testing.assert_allclose(at_tip, calculix, rtol=2e-6)


def test_elements_of_full_and_reduced_integration_are_bodies_that_are_joined(tmp_path: Path) -> None:
    """Where they share faces: the nodes of these."""
    lines = mesh_cards({"BAR": COLUMN}, "C3D20").splitlines()
    place = next(k for k, line in enumerate(lines) if line.startswith("*ELEMENT")) + 3
    lines.insert(place, "*ELEMENT, TYPE=C3D20R, ELSET=BAR")
    found = read_deck(deck(tmp_path, "\n".join(lines) + "\n" + STEEL + SECTION + NOTHING))
    assert [body.integration for body in found.scene.bodies.values()] == ["full", "reduced"]
    assert any("share 8 nodes: joined" in note for note in found.notes)


def test_linear_elements_with_a_letter_are_noted(tmp_path: Path) -> None:
    text = mesh_cards({"BAR": CUBE}, "C3D8R") + STEEL + SECTION + "*BOUNDARY\nBAR_X0, 1, 3\n"
    found = read_deck(deck(tmp_path, text + NOTHING))
    assert any("C3D8R are solved as C3D8, by full integration" in note for note in found.notes)


@pytest.mark.parametrize("normal", ["", "1., 0., 0.\n", "-1., 0., 0.\n"])
def test_a_bolt_of_cells_with_centres_is_drawn(normal: str, tmp_path: Path) -> None:
    mesh = serendipity(quadratic(block((0, 0, 0), (4, 1, 1), (4, 1, 1))))
    text = mesh_cards({"BAR": mesh}, "C3D20R") + STEEL + SECTION
    ends = "*BOUNDARY\nBAR_X0, 1\nBAR_X1, 1\nBAR_Y0, 2\nBAR_Z0, 3\n"
    bolt = "*NODE\n9000, 2., 0.5, 0.5\n*SURFACE, NAME=CUT\n2, S4\n"
    drawn = f"*PRE-TENSION SECTION, SURFACE=CUT, NODE=9000\n{normal}"
    sense = -1.0 if normal.startswith("-") else 1.0  # S4 of the second element faces x, unless it is said
    step = f"*STEP\n*STATIC\n*CLOAD\n9000, 1, {500 * sense}\n*END STEP\n"
    found = read_deck(deck(tmp_path, text + bolt + ends + drawn + step))
    body = found.scene.bodies["BAR"]
    assert body.mesh.cells_in_words == "4 serendipity hexahedra"
    assert body.integration == "reduced"
    state = found.solve(MPI.COMM_SELF, tolerance=1e-10)[-1]
    assert state.preloads()["CUT"].force == pytest.approx(500.0, rel=1e-6)
    np.testing.assert_allclose(state.gather_stress("BAR")[:, 0, 0], 500.0, rtol=1e-6)


def test_a_delay_shifts_an_amplitude(tmp_path: Path) -> None:
    text = mesh_cards({"BAR": CUBE}) + STEEL + SECTION + "*BOUNDARY\nBAR_X0, 1, 3\n"
    rising = "*AMPLITUDE, NAME=A\n0., 0., 4., 8.\n*STEP\n*STATIC\n1., 3.\n"
    loads = "*CLOAD, AMPLITUDE=A, TIME DELAY=1.\nBAR_X1, 1, 1.\n*END STEP\n"
    found = read_deck(deck(tmp_path, text + rising + loads))
    (load,) = found.steps[-1].loads or ()
    assert load.value == pytest.approx((4.0, 0.0, 0.0))  # twice the time behind the delay


def test_states_of_the_other_program_are_not_read(tmp_path: Path) -> None:
    text = mesh_cards({"BAR": CUBE}) + STEEL + SECTION + "*BOUNDARY\nBAR_X0, 1, 3\n"
    with pytest.raises(DeckError, match="supply all steps"):
        read_deck(deck(tmp_path, text + "*RESTART, READ, STEP=1\n" + NOTHING))
    found = read_deck(deck(tmp_path, text + "*RESTART, WRITE, FREQUENCY=1\n" + NOTHING))
    assert any("RESTART" in note for note in found.notes)


@pytest.mark.parametrize("definition", ["COORDINATES", "NODES"])
def test_axes_are_given_by_coordinates(definition: str, tmp_path: Path) -> None:
    lines = "*MATERIAL, NAME=STEEL\n*ELASTIC, TYPE=ENGINEERING CONSTANTS\n"
    steel = lines + "3e3, 2e3, 1e3, 0.1, 0.1, 0.1, 500., 500.\n500.,\n"
    axes = f"*ORIENTATION, NAME=AXES, DEFINITION={definition}\n0., 1., 0., -1., 0., 0.\n"
    section = "*SOLID SECTION, ELSET=BAR, MATERIAL=STEEL, ORIENTATION=AXES, OFFSET=0.\n"
    held = "*BOUNDARY\nBAR_X0, 1, 3\n"
    path = deck(tmp_path, mesh_cards({"BAR": CUBE}) + steel + axes + section + held + NOTHING)
    if definition == "NODES":
        with pytest.raises(DeckError, match="DEFINITION must be COORDINATES"):
            read_deck(path)
    else:
        assert "0.0, 1.0, 0.0" in repr(read_deck(path).scene.bodies["BAR"].materials[0])


#: Columns of six prisms: what CalculiX 2.20 prints at a corner of the loaded end.
PRISMS = {
    "C3D6": (-9.312381e-02, 1.798957e-02, 3.485777e-01),
    "C3D15": (-2.041202e-01, -3.830799e-03, 8.762649e-01),
}


def bent_prisms(element: str, law: str = "") -> str:
    cut = block((0, 0, 0), (3, 1, 1), (3, 1, 1))
    prisms = cut.cells[:, [[0, 1, 2, 4, 5, 6], [0, 2, 3, 4, 6, 7]]].reshape(-1, 6)
    mesh = named_sides(cut.points, joined_cells({"prism": prisms}))
    mesh = serendipity(quadratic(mesh)) if element == "C3D15" else mesh
    text = mesh_cards({"BAR": mesh}) + SOFT + law + SECTION + "*BOUNDARY\nBAR_X0, 1, 3\n"
    return text + "*STEP\n*STATIC\n*CLOAD\nBAR_X1, 3, 1.\n*END STEP\n"


@pytest.mark.filterwarnings("ignore")
@pytest.mark.parametrize("element", PRISMS)
def test_prisms_alone_have_the_points_of_calculix(element: str, tmp_path: Path) -> None:
    text = bent_prisms(element)
    assert f"TYPE={element}," in text
    found, _, moved, places = solved(tmp_path, text, 1e-10)
    assert not found.notes
    corner = next(number for number, place in places.items() if np.allclose(place, (3, 1, 1)))
    np.testing.assert_allclose(moved[corner], PRISMS[element], rtol=2e-6)


def test_prisms_of_metals_are_integrated_in_full(tmp_path: Path) -> None:
    found = read_deck(deck(tmp_path, bent_prisms("C3D15", "*PLASTIC\n100., 0.\n200., 1.\n")))
    assert any("prisms of such a material are integrated in full" in note for note in found.notes)
    assert found.scene.bodies["BAR"].element.integration == FULL


@pytest.mark.parametrize(("element", "count"), [("CAX3", 2), ("CAX6", 9)])
def test_triangles_of_revolution_are_noted_as_integrated_otherwise(
    element: str, count: int, tmp_path: Path
) -> None:
    mesh = rectangle((1.0, 0.0), (2.0, 1.0), (1, 1), "triangle")
    mesh = quadratic(mesh) if element == "CAX6" else mesh
    text = mesh_cards({"BAR": mesh}, element) + STEEL + SECTION + "*BOUNDARY\nBAR_Y0, 1, 2\n" + NOTHING
    words = f"elements {element} are integrated in full, CalculiX takes {count} points"
    assert any(words in note for note in read_deck(deck(tmp_path, text)).notes)
