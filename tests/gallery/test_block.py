"""A block is a box with six named sides."""

from __future__ import annotations

import numpy as np
import pytest

from fenics_contact import BodyMesh
from fenics_contact.errors import InvalidInputError
from fenics_contact.gallery import block, box_lattice, growing_ticks, rectangle
from fenics_contact.gallery.blocks import split_hexahedra
from fenics_contact.mesh import scaled_jacobian
from fenics_contact.mesh.faces import vector_areas

CELLS = ["hexahedron", "tetrahedron"]
NORMALS = {
    "x0": [-6, 0, 0],
    "x1": [6, 0, 0],
    "y0": [0, -3, 0],
    "y1": [0, 3, 0],
    "z0": [0, 0, -2],
    "z1": [0, 0, 2],
}
"""Outward normal times area of the sides of a box of size 1 x 2 x 3."""


@pytest.mark.parametrize("cell", CELLS)
def test_the_sides_are_complete_plane_and_face_outwards(cell: str) -> None:
    mesh = block((1, 1, 1), (2, 3, 4), (2, 3, 4), cell)
    assert set(mesh.surfaces) == set(NORMALS)
    for d in range(3):
        for end, plane in ((0, 1.0), (1, 2.0 + d)):
            facets = mesh.surfaces[f"{'xyz'[d]}{end}"]
            assert np.all(mesh.points[facets][:, :, d] == plane)
            assert vector_areas(mesh.points, facets).sum(axis=0) == pytest.approx(NORMALS[f"{'xyz'[d]}{end}"])


@pytest.mark.parametrize(("cell", "factor"), [("hexahedron", 1), ("tetrahedron", 6)])
def test_it_has_the_cells_asked_for_and_fills_the_box(cell: str, factor: int) -> None:
    mesh = block((1, 1, 1), (2, 3, 4), (2, 3, 4), cell)
    assert (mesh.n_cells, mesh.n_nodes, mesh.cell_type) == (24 * factor, 60, cell)
    assert mesh.volume == pytest.approx(6.0)


@pytest.mark.parametrize("cell", CELLS)
def test_the_grid_index_is_the_place_in_the_box(cell: str) -> None:
    mesh = block((0, 0, 0), (2, 3, 4), (2, 3, 4), cell)
    assert mesh.grid is not None
    assert np.array_equal(mesh.grid, np.floor(mesh.points[mesh.cells].mean(axis=1)))


def test_planes_may_be_spaced_as_one_likes() -> None:
    mesh = box_lattice([np.array([0.0, 1.0, 4.0]), np.array([0.0, 1.0]), np.array([0.0, 2.0])])
    assert sorted(np.unique(mesh.points[:, 0])) == [0.0, 1.0, 4.0]
    assert mesh.volume == pytest.approx(8.0)


def test_ticks_grow_from_the_first_cell_by_their_ratio_to_the_end() -> None:
    ticks = growing_ticks(7.0, 0.1, 1.25)
    cells = np.diff(ticks)
    np.testing.assert_allclose(cells[1:] / cells[:-1], 1.25)
    assert (ticks[0], ticks[-1]) == (0.0, 7.0)
    assert 0.1 / 1.25 < cells[0] <= 0.1
    for wrong in ((0.0, 0.1, 1.2), (1.0, -0.1, 1.2), (1.0, 0.1, 1.0)):
        with pytest.raises(InvalidInputError, match=r"ratio greater than 1, got .*take numpy.linspace"):
            growing_ticks(*wrong)


def test_a_grading_makes_cells_small_at_one_corner() -> None:
    points = block((0, 0, 0), (2, 1, 1), (4, 4, 4), grading=(2.0, -2.0, 0.0)).points
    x, y, z = (np.diff(np.unique(points[:, axis].round(12))) for axis in range(3))
    assert x[-1] / x[0] == pytest.approx(np.exp(2.0 * 3 / 4))
    np.testing.assert_allclose(x / 2, y[::-1])
    np.testing.assert_allclose(z, 0.25)
    plane = rectangle((0, 0), (2, 1), (4, 4), grading=(2.0, -2.0)).points
    np.testing.assert_array_equal(np.unique(plane[:, 0]), np.unique(points[:, 0]))


@pytest.mark.parametrize(
    ("grading", "message"),
    [((9.0, 0, 0), "grading must lie between -8 and 8, got"), ((1.0,), "grading must be 3 finite numbers")],
)
def test_a_grading_that_cannot_be_is_refused(grading: tuple[float, ...], message: str) -> None:
    with pytest.raises(InvalidInputError, match=message):
        block((0, 0, 0), (1, 1, 1), (2, 2, 2), grading=grading)


def test_mirrored_layers_still_fit_together() -> None:
    mesh = block((0, 0, 0), (4, 4, 4), (4, 4, 4))
    assert mesh.grid is not None
    split = split_hexahedra(mesh, mesh.grid >= 2)
    assert split.volume == pytest.approx(64.0)
    middle = np.flatnonzero(np.all(split.points == 2.0, axis=1))
    meeting = np.count_nonzero(np.any(split.cells == middle, axis=1))
    assert meeting == 48, "all eight diagonals end in the middle, with six tetrahedra each"
    assert scaled_jacobian(split.points, split.cells).min() > 0.3


def test_hexahedra_numbered_at_random_are_not_split() -> None:
    mesh = block((0, 0, 0), (2, 1, 1), (2, 1, 1))
    cells = mesh.cells.copy()
    cells[1] = cells[1, [3, 0, 1, 2, 7, 4, 5, 6]]
    with pytest.raises(InvalidInputError, match="some neighbours' diagonals do not meet"):
        split_hexahedra(BodyMesh(mesh.points, cells))


def test_a_box_without_volume_is_refused() -> None:
    with pytest.raises(
        InvalidInputError, match=r"upper must exceed lower .* lower \[0, 0, 0\] and upper \[1, 0, 1\]"
    ):
        block((0, 0, 0), (1, 0, 1), (1, 1, 1))


@pytest.mark.parametrize("count", [0, -2, 1.5, True])
def test_a_count_that_is_none_is_refused(count: object) -> None:
    with pytest.raises(
        InvalidInputError, match=rf"counts\[1\] must be an integer of at least 1, got {count}"
    ):
        block((0, 0, 0), (1, 1, 1), (1, count, 1))  # type: ignore[arg-type]


def test_two_counts_are_refused() -> None:
    with pytest.raises(InvalidInputError, match=r"counts must be three integers, got \(1, 1\)"):
        block((0, 0, 0), (1, 1, 1), (1, 1))  # type: ignore[arg-type]


def test_an_unknown_cell_type_is_refused() -> None:
    with pytest.raises(InvalidInputError, match=r"cell must be one of .*, got 'wedge'"):
        block((0, 0, 0), (1, 1, 1), (1, 1, 1), "wedge")
