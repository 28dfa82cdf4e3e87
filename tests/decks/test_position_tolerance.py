"""Ties of decks reach as far as their position tolerance, by default 2.5 % of a face's edge."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest
from mpi4py import MPI

from fenics_contact import BodyMesh
from fenics_contact.decks import read_deck
from fenics_contact.gallery import block, rectangle
from fenics_contact.mesh import quadratic
from tests.decks.texts import STEEL, deck, mesh_cards, step

#: A block of 1 × 1 × 1 that stands, and another one above it that hangs; E = 210 000, no Poisson's ratio.
FORCE = 2100.0


def blocks(gap: float, tie: str, tilt: float = 0.0) -> str:
    """Return two blocks with a gap that grows by `tilt` along x, and a force on the top of the lower one."""
    upper = block((0, 0, 1), (1, 1, 2), (2, 1, 1))
    points = upper.points.copy()
    points[:, 2] += gap + tilt * points[:, 0]
    meshes = {"LOW": block((0, 0, 0), (1, 1, 1), (1, 1, 1)), "UP": upper.moved(points)}
    sections = "".join(f"*SOLID SECTION, ELSET={name}, MATERIAL=STEEL\n" for name in meshes)
    surfaces = "*SURFACE, NAME=FEET\nUP, S1\n*SURFACE, NAME=TABLE\nLOW, S2\n"
    held = "*BOUNDARY\nLOW_Z0, 1, 3\nUP_Z1, 1, 3\n"
    cards = mesh_cards(meshes) + STEEL.replace("0.3", "0.") + sections + surfaces + tie + held
    return cards + step(f"*CLOAD\nLOW_Z1, 3, {FORCE / 4}\n")


TIE = "*TIE, NAME=GLUE\nFEET, TABLE\n"
GIVEN = "*TIE, NAME=GLUE, POSITION TOLERANCE={}\nFEET, TABLE\n"
ALONE, BOTH = 0.01, 0.005


@pytest.mark.parametrize(
    ("gap", "tie", "lifted", "notes"),
    [
        (0.0, TIE, BOTH, []),
        (0.02, TIE, BOTH, ["gaps of up to 0.02 stay"]),
        (0.03, TIE, ALONE, ["6 nodes of FEET, such as 9, are farther from TABLE than"]),
        (0.5, GIVEN.format(0.6), BOTH, ["gaps of up to 0.5 stay"]),
        (0.02, GIVEN.format(0.01), ALONE, ["tolerance 0.01: they stay apart, and 2 of 2 faces"]),
    ],
)  # fmt: skip
def test_a_tie_reaches_as_far_as_its_tolerance(
    gap: float, tie: str, lifted: float, notes: list[str], tmp_path: Path
) -> None:
    """A force on the lower block lifts its top by F h / E A alone, by half of it with the other one."""
    found = read_deck(deck(tmp_path, blocks(gap, tie)))
    (state,) = found.solve(MPI.COMM_SELF, tolerance=1e-10)
    top = state.gather_displacement("LOW")[:, 2].max()
    # Corners of a block with no Poisson's ratio move alike; a gap makes the link longer, not softer.
    assert top == pytest.approx(lifted, rel=1e-6)
    about = [note for note in found.notes if "TIE" in note]
    assert len(about) == len(notes)
    assert all(words in note for words, note in zip(notes, about, strict=True))


def test_faces_within_the_tolerance_are_tied_and_others_stay_apart(tmp_path: Path) -> None:
    found = read_deck(deck(tmp_path, blocks(0.0, TIE, tilt=0.04)))
    (tie,) = found.scene.ties
    facets = found.scene.bodies["UP"].mesh.surfaces[tie.slave.name]
    assert len(facets) == 1
    assert found.scene.bodies["UP"].mesh.points[facets][..., 0].max() == 0.5
    assert any("2 nodes of FEET, such as 17, are farther" in note for note in found.notes)
    assert any("1 of 2 faces, which have such nodes, are not tied" in note for note in found.notes)


def ring(radius: float, width: float, count: int, dim: int) -> BodyMesh:
    """Return a quarter of a ring of quadratic cells."""
    if dim == 2:
        mesh = quadratic(rectangle((0, 0), (1, 1), (1, count)))
    else:
        mesh = quadratic(block((0, 0, 0), (1, 1, 1), (1, count, 1)))
    out, turn = radius + width * mesh.points[:, 0], 0.5 * np.pi * mesh.points[:, 1]
    points = mesh.points.copy()
    points[:, 0], points[:, 1] = out * np.cos(turn), out * np.sin(turn)
    return mesh.moved(points)


@pytest.mark.parametrize(("dim", "element"), [(2, "CPE8"), (3, "C3D20R")])
def test_nodes_in_the_middle_of_edges_count_for_the_distance(dim: int, element: str, tmp_path: Path) -> None:
    """Round faces of four cells in a quarter: chords are off by 5 % of an edge, halves of them by 1.2 %."""
    meshes = {"IN": ring(1.0, 0.5, 4, dim), "OUT": ring(1.5, 0.5, 7, dim)}
    text = mesh_cards(meshes, element) + STEEL
    text += "".join(f"*SOLID SECTION, ELSET={name}, MATERIAL=STEEL\n" for name in meshes)
    inner, outer = ("S4", "S2") if dim == 2 else ("S6", "S4")
    text += f"*SURFACE, NAME=HOLE\nOUT, {inner}\n*SURFACE, NAME=PIN\nIN, {outer}\n"
    found = read_deck(deck(tmp_path, text + "*TIE, NAME=T\nHOLE, PIN\n*BOUNDARY\nIN_X0, 1, 3\n" + step("")))
    (tie,) = found.scene.ties
    assert tie.slave.name == "HOLE"
    assert not any("farther" in note for note in found.notes)
    points = found.scene.bodies["OUT"].mesh.points[found.scene.bodies["OUT"].mesh.surfaces["HOLE"]]
    np.testing.assert_allclose(np.linalg.norm(points[..., :2], axis=-1)[:, :2], 1.5, rtol=1e-9)
