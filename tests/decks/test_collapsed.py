"""Elements of decks that list nodes twice, as CalculiX takes them: prisms, pyramids, triangles."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest
from mpi4py import MPI

from fenics_contact.decks import read_deck, write_scene_file
from fenics_contact.gallery import block, rectangle
from fenics_contact.mesh.body_mesh import BodyMesh
from fenics_contact.readers.deck_bodies import read_deck_mesh
from fenics_contact.readers.deck_cards import DeckError
from tests.decks.texts import SECTION, STEEL, deck

#: Displacements of two nodes of `swept` by CalculiX 2.20, elements C3D8.
BY_CALCULIX = {
    27: [4.261430e-02, -7.784225e-05, -2.182365e-02],
    18: [4.134111e-02, -3.102234e-04, -5.479437e-03],
}


def cards(mesh: BodyMesh, element: str) -> str:
    """Return nodes and elements of a mesh, of nodes in one place the first alone."""
    points = mesh.points.round(12)
    _, first, back = np.unique(points, axis=0, return_index=True, return_inverse=True)
    node = first[back.ravel()]
    lines = ["*NODE"]
    for n in np.unique(node):
        lines.append(", ".join([str(n + 1), *(f"{x:.15g}" for x in points[n])]))
    lines.append(f"*ELEMENT, TYPE={element}, ELSET=BAR")
    lines += [", ".join(map(str, [k + 1, *(node[cell] + 1)])) for k, cell in enumerate(mesh.cells)]
    low, high = (np.unique(node[mesh.surfaces[side]]) + 1 for side in ("z0", "z1"))
    for name, nodes in (("LOW", low), ("HIGH", high)):
        lines += [f"*NSET, NSET={name}", *(f"{n}," for n in nodes)]
    radius = np.hypot(*points[:, :2].T)[mesh.cells].max(axis=1)
    outer = 1 + np.flatnonzero(radius > 0.99)
    return "\n".join([*lines, "*ELSET, ELSET=OUTER", *(f"{k}," for k in outer), ""])


def swept(angles: int = 3) -> BodyMesh:
    """Return a quarter of a cylinder swept around its axis, where hexahedra are prisms."""
    flat = block((0, 0, 0), (1, 1, 2), (2, angles, 2))
    r, t, z = flat.points.T
    moved = np.column_stack([r * np.cos(t * np.pi / 2), r * np.sin(t * np.pi / 2), z])
    mesh = BodyMesh.__new__(BodyMesh)
    mesh._set(points=moved, cells=flat.cells, surfaces=flat.surfaces)
    return mesh


LOAD = """*BOUNDARY
LOW, 1, 3
*STEP
*STATIC
*CLOAD
HIGH, 1, 30.
HIGH, 3, -50.
*DLOAD
OUTER, P4, 40.
*END STEP
"""


def test_a_swept_mesh_moves_as_in_calculix(tmp_path: Path) -> None:
    found = read_deck(deck(tmp_path, cards(swept(), "C3D8") + STEEL + SECTION + LOAD))
    body = found.scene.bodies["BAR"]
    assert body.mesh.cells_in_words == "6 prisms and 6 hexahedra"
    (state,) = found.solve(MPI.COMM_SELF, tolerance=1e-10)
    moved, number = state.gather_displacement("BAR"), found.node_numbers["BAR"]
    for node, by_calculix in BY_CALCULIX.items():
        np.testing.assert_allclose(moved[number == node][0], by_calculix, atol=2e-6 * np.abs(moved).max())
    # As a scene file the elements are those of the deck.
    write_scene_file(found, tmp_path / "bar.toml")
    (again,) = read_deck_mesh(tmp_path / "bar_mesh.inp").values()
    assert again.cells_in_words == body.mesh.cells_in_words


def test_all_shapes_are_found_whatever_stands_first(tmp_path: Path) -> None:
    """Each cell of a box of 1 becomes another shape by its repeated nodes, with the volumes of these."""
    box = block((0, 0, 0), (1, 1, 1), (1, 1, 1))
    points = "*NODE\n" + "\n".join(f"{k + 1}, {x}, {y}, {z}" for k, (x, y, z) in enumerate(box.points))
    a, b, c, _, e, f, g, _ = (box.cells[0] + 1).tolist()
    for rows, volume in (
        ([a, b, c, c, e, f, g, g], 1 / 2),
        ([b, c, a, a, f, g, e, e], 1 / 2),
        ([a, a, b, c, e, e, f, g], 1 / 2),
        ([b, f, g, c, a, a, a, a], 1 / 3),
        ([a, b, c, c, f, f, f, f], 1 / 6),
    ):
        used = sorted(set(rows))
        kept = "\n".join(
            line for line in points.splitlines() if line[0] == "*" or int(line.split(",")[0]) in used
        )
        text = f"{kept}\n*ELEMENT, TYPE=C3D8, ELSET=BAR\n1, {', '.join(map(str, rows))}\n"
        (mesh,) = read_deck_mesh(deck(tmp_path, text + STEEL + SECTION)).values()
        assert mesh.volume == pytest.approx(volume)


def test_quadrilaterals_are_triangles(tmp_path: Path) -> None:
    plate = rectangle((0, 0), (1, 1), (1, 1))
    points = "\n".join(f"{k + 1}, {x}, {y}" for k, (x, y) in enumerate(plate.points))
    a, b, c, d = (plate.cells[0] + 1).tolist()
    elements = f"*ELEMENT, TYPE=CPS4, ELSET=BAR\n1, {a}, {b}, {c}, {c}\n2, {c}, {c}, {d}, {a}\n"
    (mesh,) = read_deck_mesh(deck(tmp_path, f"*NODE\n{points}\n{elements}{STEEL}{SECTION}")).values()
    assert mesh.cells_in_words == "2 triangles"
    assert mesh.volume == pytest.approx(1.0)


def test_what_is_no_such_shape_is_refused(tmp_path: Path) -> None:
    text = cards(swept(), "C3D8")
    edge = "*SURFACE, NAME=S\nBAR, S6\n"
    with pytest.raises(DeckError, match=r"\*SURFACE: face 'S6' of element \d+ is only an edge"):
        read_deck(deck(tmp_path, text + edge + STEEL + SECTION + LOAD))
    first = next(line for line in text.splitlines() if line.startswith("1, ") and line.count(",") == 8)
    number, a, b, *rest = first.split(", ")
    twisted = text.replace(first, ", ".join([number, b, a, b, a, *rest[2:]]))
    with pytest.raises(DeckError, match=r"1 elements C3D8 list nodes twice, first 1: they"):
        read_deck(deck(tmp_path, twisted + STEEL + SECTION + LOAD))
