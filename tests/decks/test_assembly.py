"""Parts, instances and assemblies: the same answer as of a flat deck, numbers of instances, mistakes."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest
from mpi4py import MPI

from fenics_contact import read_scene_file
from fenics_contact.decks import read_deck, write_scene_file
from fenics_contact.decks.tables import write_tables
from fenics_contact.gallery import block
from fenics_contact.mesh.body_mesh import BodyMesh
from fenics_contact.readers.deck_bodies import read_deck_mesh
from fenics_contact.readers.deck_cards import DeckError
from tests.decks.texts import STEEL, mesh_cards

PLATE = block((0, 0, 0), (2, 1, 1), (4, 2, 2))
BLOCK = block((0, 0, 0), (1, 1, 1), (3, 3, 2))
#: The second block, moved by (2, 0, 1) and turned by 90 degrees about the line through (2, 0) along z.
TURNED = BLOCK.moved(np.column_stack([2 - BLOCK.points[:, 1], BLOCK.points[:, 0], 1 + BLOCK.points[:, 2]]))
INTERACTION = """*Surface Interaction, name=Hard
1.,
*Friction
0.2,
*Surface Behavior, pressure-overclosure=HARD
"""
STEP = """*Step, name=Press, nlgeom=NO
*Static
1., 1., 1e-05, 1.
*Boundary
{tops}, 3, 3, -0.001
*Restart, write, frequency=0
*Output, field, variable=PRESELECT
*Node Print, nset={printed}
U
*El Print, elset={elements}
S
*End Step
"""


def bottom(mesh: BodyMesh) -> str:
    """Return the numbers of the elements at z = 0, which have it as face S1."""
    low = np.flatnonzero(mesh.points[mesh.cells][:, :, 2].min(axis=1) < 1e-9)
    return ", ".join(map(str, low + 1))


def top(mesh: BodyMesh) -> str:
    high = np.flatnonzero(mesh.points[mesh.cells][:, :, 2].max(axis=1) > 1 - 1e-9)
    return ", ".join(map(str, high + 1))


def assembled(second: str = "  2., 0., 1.\n  2., 0., 1., 2., 0., 2., 90.\n") -> str:
    """Return a deck as Abaqus/CAE writes it: two instances of a block on a plate."""
    return f"""*Heading
** Job name: press
*Preprint, echo=NO, model=NO, history=NO, contact=NO
**
*Part, name=Plate
{mesh_cards({"P": PLATE})}*Elset, elset=High
{top(PLATE)}
*Surface, type=ELEMENT, name=Face
High, S2
** Section: steel
*Solid Section, elset=P, material=Steel
,
*End Part
*Part, name=Block
{mesh_cards({"A": BLOCK})}*Solid Section, elset=A, material=Steel
,
*End Part
**
*Assembly, name=Assembly
*Instance, name=Plate-1, part=Plate
*End Instance
*Instance, name=Block-1, part=Block
  0., 0., 1.
*End Instance
*Instance, name=Block-2, part=Block
{second}*End Instance
*Nset, nset=Tops, instance=Block-1
 A_Z1,
*Nset, nset=Tops, instance=Block-2
 A_Z1,
*Elset, elset=_Feet_S1, internal, instance=Block-1
 {bottom(BLOCK)}
*Elset, elset=_Feet2_S1, internal, instance=Block-2
 {bottom(BLOCK)}
*Surface, type=ELEMENT, name=Feet
_Feet_S1, S1
*Surface, type=ELEMENT, name=Feet2
_Feet2_S1, S1
*End Assembly
{STEEL}{INTERACTION}*Boundary
Plate-1.P_Z0, ENCASTRE
Block-1.1, 1, 2
Block-1.A_X0, 1, 1
Block-2.A_Z1, 1, 2
Block-1.A_Z1, 2, 2
*Contact Pair, interaction=Hard, type=SURFACE TO SURFACE
Feet, Plate-1.Face
Feet2, Plate-1.Face
{STEP.format(tops="Tops", printed="Block-2.A_Z1", elements="Block-2.A")}"""


def flat() -> str:
    """Return the same without instances."""
    raised = BLOCK.moved(BLOCK.points + np.array([0.0, 0.0, 1.0]))
    first, second = (1 + PLATE.n_cells, 1 + PLATE.n_cells + BLOCK.n_cells)
    low = np.flatnonzero(BLOCK.points[BLOCK.cells][:, :, 2].min(axis=1) < 1e-9)
    feet = [", ".join(map(str, low + start)) for start in (first, second)]
    corner = PLATE.n_nodes + 1
    return f"""{mesh_cards({"P": PLATE, "A": raised, "B": TURNED})}*Elset, elset=High
{top(PLATE)}
*Elset, elset=Low
{feet[0]}
*Elset, elset=Low2
{feet[1]}
*Surface, type=ELEMENT, name=Face
High, S2
*Surface, type=ELEMENT, name=Feet
Low, S1
*Surface, type=ELEMENT, name=Feet2
Low2, S1
*Solid Section, elset=P, material=Steel
*Solid Section, elset=A, material=Steel
*Solid Section, elset=B, material=Steel
*Nset, nset=Tops
A_Z1, B_Z1
{STEEL}{INTERACTION}*Boundary
P_Z0, ENCASTRE
{corner}, 1, 2
A_X0, 1, 1
B_Z1, 1, 2
A_Z1, 2, 2
*Contact Pair, interaction=Hard, type=SURFACE TO SURFACE
Feet, Face
Feet2, Face
{STEP.format(tops="Tops", printed="B_Z1", elements="B")}"""


def written(folder: Path, text: str) -> Path:
    path = folder / "press.inp"
    path.write_text(text)
    return path


def test_an_assembly_has_the_answer_of_the_flat_deck(tmp_path: Path) -> None:
    deck = read_deck(written(tmp_path, assembled()))
    assert list(deck.scene.bodies) == ["PLATE-1", "BLOCK-1", "BLOCK-2"]
    np.testing.assert_allclose(deck.scene.bodies["BLOCK-2"].mesh.points, TURNED.points, atol=1e-14)
    (state,) = deck.solve(MPI.COMM_SELF, tolerance=1e-10)
    same = read_deck(written(tmp_path, flat()))
    (other,) = same.solve(MPI.COMM_SELF, tolerance=1e-10)
    for mine, theirs in (("PLATE-1", "P"), ("BLOCK-1", "A"), ("BLOCK-2", "B")):
        moved = other.gather_displacement(theirs)
        np.testing.assert_allclose(state.gather_displacement(mine), moved, atol=1e-8 * np.abs(moved).max())
    assert np.abs(state.gather_displacement("PLATE-1")).max() > 1e-4
    # Tables have the numbers that nodes and elements have in their instance.
    for table, flat_table, mesh_size in zip(
        deck.tables(state), same.tables(other), (PLATE.n_nodes + BLOCK.n_nodes, 0), strict=True
    ):
        assert set(table.instances) == {"BLOCK-2"}
        start = mesh_size or PLATE.n_cells + BLOCK.n_cells
        np.testing.assert_array_equal(table.rows[:, 0], flat_table.rows[:, 0] - start)
        largest = np.abs(flat_table.rows[:, 1:]).max()
        np.testing.assert_allclose(table.rows[:, 1:], flat_table.rows[:, 1:], atol=1e-7 * largest)
    path = write_tables(deck.tables(state)[:1], tmp_path / "prints")[0]
    lines = path.read_text().splitlines()
    assert lines[0] == "instance,node,ux,uy,uz"
    assert lines[1].startswith("BLOCK-2,")


def test_the_mesh_of_an_assembly_is_read_alone(tmp_path: Path) -> None:
    found = read_deck_mesh(written(tmp_path, assembled()))
    assert list(found) == ["PLATE-1", "BLOCK-1", "BLOCK-2"]
    assert "FEET2" in found["BLOCK-2"].surfaces
    assert "PLATE-1.FACE" in found["PLATE-1"].surfaces


def test_orientations_turn_with_their_instances(tmp_path: Path) -> None:
    """A bar of wood, stiff along its length, pulled across and along: as two bars that are written so."""
    wood = """*Material, name=Wood
*Elastic, type=ENGINEERING CONSTANTS
1000., 100., 100., 0., 0., 0., 50., 50.,
50.
"""
    bar = block((0, 0, 0), (2, 1, 1), (2, 1, 1))
    text = f"""*Part, name=Bar
{mesh_cards({"A": bar})}*Orientation, name=Grain, system=RECTANGULAR
1., 0., 0., 0., 1., 0.
*Solid Section, elset=A, orientation=Grain, material=Wood
,
*End Part
*Assembly, name=Two
*Instance, name=Along, part=Bar
*End Instance
*Instance, name=Up, part=Bar
5., 0., 0.
5., 0., 0., 5., 1., 0., -90.
*End Instance
*End Assembly
{wood}*Boundary
Along.A_X0, 1, 3
Up.A_X0, 1, 3
*Step
*Static
*Cload
{"".join(f"Along.{n}, 1, 1." + chr(10) + f"Up.{n}, 3, 1." + chr(10) for n in 1 + bar.nodes_of("x1"))}*End Step
"""
    deck = read_deck(written(tmp_path, text))
    x, y, z = bar.points.T
    turned = np.column_stack([5 - z, y, x])
    np.testing.assert_allclose(deck.scene.bodies["UP"].mesh.points, turned, atol=1e-14)
    (state,) = deck.solve(MPI.COMM_SELF, tolerance=1e-12)
    along, up = (state.gather_displacement(name) for name in ("ALONG", "UP"))
    assert along[:, 0].max() == pytest.approx(0.008, rel=0.01)
    np.testing.assert_allclose(up[:, 2], along[:, 0], atol=1e-12)


MISTAKES = [
    (("part=Block\n  0.", "part=Blck\n  0."), r"line \d+: \*INSTANCE: part 'BLCK' is not there; the deck"),
    (("name=Block-2", "name=Block-1"), r"\*INSTANCE: instance 'BLOCK-1' is there already"),
    (("instance=Block-2\n A_Z1", "instance=Block-3\n A_Z1"), r"\*NSET: instance 'BLOCK-3' is not there"),
    (("instance=Block-2\n A_Z1", "instance=Block-2\n 9999"), r"\*NSET: BLOCK-2\.9999 is not there"),
    (("*End Assembly\n", ""), r"\*ASSEMBLY: is not closed: add \*END ASSEMBLY"),
    (("Block-1.1, 1, 2", "Block-1.999, 1, 2"), r"\*BOUNDARY: BLOCK-1\.999 is not there"),
    (("Block-1.1, 1, 2", "Block-1.88, 1, 2"), r"\*BOUNDARY: node BLOCK-1\.88 is not there"),
    (("*End Part\n*Part", "*Tie, name=a\n*End Part\n*Part"), r"\*TIE: this card is not supported within"),
    (("  0., 0., 1.\n", "  0., 0., 1.\n 0., 0., 1.\n"), r"\*INSTANCE: needs two points and an angle, got"),
    (("Plate-1, part=Plate", "Plate-1, library=old"), r"\*INSTANCE: the parameter LIBRARY is not read"),
    (("Block-1.A_X0", "Block-1.A_X7"), r"node set 'BLOCK-1\.A_X7' is not there; did you mean BLOCK"),
]  # fmt: skip


@pytest.mark.parametrize(("change", "words"), MISTAKES)
def test_mistakes_are_told_with_card_and_line(tmp_path: Path, change: tuple[str, str], words: str) -> None:
    before = assembled()
    assert change[0] in before
    with pytest.raises(DeckError, match=words):
        read_deck(written(tmp_path, before.replace(*change)))


def test_plane_parts_stay_in_their_plane(tmp_path: Path) -> None:
    text = assembled().replace("type=C3D8", "type=CPS4").replace("TYPE=C3D8", "TYPE=CPS4")
    with pytest.raises(DeckError, match=r"CPS4 of part 'BLOCK' must stay in its plane"):
        read_deck(written(tmp_path, text))


def test_a_scene_file_has_the_answer_of_an_assembly(tmp_path: Path) -> None:
    deck = read_deck(written(tmp_path, assembled()))
    write_scene_file(deck, tmp_path / "press.toml")
    again = read_scene_file(tmp_path / "press.toml", MPI.COMM_SELF).solve()
    (state,) = deck.solve(MPI.COMM_SELF)
    for name in ("PLATE-1", "BLOCK-2"):
        moved = state.gather_displacement(name)
        np.testing.assert_allclose(again.gather_displacement(name), moved, atol=1e-6 * np.abs(moved).max())
