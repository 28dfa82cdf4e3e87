"""Cells that are inverted or flat are refused when the mesh is made, before any scene."""

from __future__ import annotations

import numpy as np
import pytest

from fenics_contact import BodyMesh
from fenics_contact.errors import InvalidInputError
from fenics_contact.gallery import block
from tests.hard.conftest import Record

CELLS = ("hexahedron", "tetrahedron")


@pytest.mark.parametrize("cell", CELLS)
def test_a_mesh_with_an_inverted_cell_is_refused_by_its_place(cell: str, record: Record) -> None:
    mesh = block((0, 0, 0), (2, 1, 1), (4, 2, 2), cell)
    points = mesh.points.copy()
    inner = np.flatnonzero((points == [1.0, 0.5, 0.5]).all(axis=1))[0]
    points[inner] += [0.0, 0.0, 0.8]
    with pytest.raises(InvalidInputError, match=r"positive Jacobian, .* the worst is cell") as error:
        mesh.moved(points)
    record("meshes", f"{cell.replace('hedron', 'hedra')}, some inverted", outcome=f"refused: {error.value}")


@pytest.mark.parametrize("cell", CELLS)
def test_a_mesh_that_was_mirrored_without_its_vertices_reordered_is_refused(
    cell: str, record: Record
) -> None:
    mesh = block((0, 0, 0), (2, 1, 1), (4, 2, 2), cell)
    with pytest.raises(InvalidInputError, match="every cell must have a positive Jacobian") as error:
        BodyMesh(mesh.points * [1.0, -1.0, 1.0], mesh.cells)
    record(
        "meshes", f"{cell.replace('hedron', 'hedra')} mirrored without reordering their vertices",
        outcome=f"refused: {error.value}",
    )  # fmt: skip


def test_a_flat_cell_is_refused(record: Record) -> None:
    points = np.array([[0, 0, 0], [1, 0, 0], [0, 1, 0], [1, 1, 0.0]])
    with pytest.raises(InvalidInputError, match="positive Jacobian, 1 of 1 are inverted or flat") as error:
        BodyMesh(points, np.array([[0, 1, 2, 3]]))
    record("meshes", "a tetrahedron without volume", outcome=f"refused: {error.value}")
