"""Regions share a body out among themselves; nodes at the same place are found, refused or joined."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from fenics_contact import BodyMesh
from fenics_contact.errors import InvalidInputError
from fenics_contact.gallery import block, rectangle
from fenics_contact.gallery.blocks import split_hexahedra, split_quadrilaterals
from fenics_contact.mesh import boundary_faces, merge_duplicate_nodes


def with_regions(regions: dict[str, object]) -> BodyMesh:
    mesh = block((0, 0, 0), (4, 1, 1), (4, 1, 1))
    return BodyMesh(mesh.points, mesh.cells, mesh.surfaces, mesh.grid, regions)  # type: ignore[arg-type]


def test_regions_are_ascending_and_cannot_be_written() -> None:
    mesh = with_regions({"steel": [3, 0], "copper": np.array([1, 2])})
    assert {name: cells.tolist() for name, cells in mesh.regions.items()} == {
        "steel": [0, 3],
        "copper": [1, 2],
    }
    assert mesh.regions["steel"].dtype == np.int64
    with pytest.raises(ValueError, match="read-only"):
        mesh.regions["steel"][0] = 1
    assert mesh.moved(2.0 * mesh.points).regions is mesh.regions


def test_a_body_without_regions_has_none() -> None:
    assert dict(block((0, 0, 0), (1, 1, 1), (1, 1, 1)).regions) == {}


@pytest.mark.parametrize(
    ("regions", "message"),
    [
        ({"a": [0, 1, 2], "b": [2, 3]}, "1 of region 'b' are in it twice or in another too, first cell 2"),
        ({"a": [0, 1, 1, 2, 3]}, "1 of region 'a' are in it twice .* first cell 1"),
        ({"a": [0], "b": [3]}, "2 of 4 do not, first cell 1: give the rest a region"),
        ({"a": [0, 1, 2, 3], "b": np.zeros(0, dtype=int)}, "region 'b' .* got none: .* leave out a region"),
        ({"a": [0, 1, 2, 4]}, "region 'a' must hold cell numbers from 0 to 3, got 0 to 4"),
        ({"a": [-1, 1, 2, 3]}, "got -1 to 3"),
        ({"a": [0.0, 1.0]}, "region 'a' must be integers, got float64"),
    ],
)
def test_regions_that_do_not_share_out_the_body_are_refused(regions: dict[str, object], message: str) -> None:
    with pytest.raises(InvalidInputError, match=message):
        with_regions(regions)


def test_regions_follow_their_cells_when_these_are_split() -> None:
    mesh = with_regions({"left": [0, 1], "right": [2, 3]})
    split = split_hexahedra(mesh)
    for name, low, high in (("left", 0.0, 2.0), ("right", 2.0, 4.0)):
        corners = split.points[split.cells[split.regions[name]], 0]
        assert (corners.shape[0], corners.min(), corners.max()) == (12, low, high)
    plane = rectangle((0, 0), (2, 1), (2, 1))
    plane = BodyMesh(plane.points, plane.cells, regions={"a": np.array([1]), "b": np.array([0])})
    assert split_quadrilaterals(plane).regions["a"].tolist() == [2, 3]


def torn_block(cell: str = "hexahedron") -> tuple[np.ndarray, np.ndarray]:
    """Points and cells of two blocks side by side that do not share the nodes between them."""
    one = block((0, 0, 0), (1, 1, 1), (1, 1, 1), cell)
    points = np.vstack([one.points, one.points + np.array([1.0, 0.0, 0.0])])
    return points, np.vstack([one.cells, one.cells + one.n_nodes])


@pytest.mark.parametrize("cell", ["hexahedron", "tetrahedron"])
def test_coincident_nodes_are_refused_with_how_many_which_and_what_to_do(cell: str) -> None:
    points, cells = torn_block(cell)
    message = r"8 of 16 nodes coincide .* first nodes 4 and 8 at \(1, 0, 0\): .*`merge_duplicate_nodes"
    with pytest.raises(InvalidInputError, match=message):
        BodyMesh(points, cells)


def test_nodes_that_nearly_coincide_are_refused_and_near_ones_are_not() -> None:
    points, cells = torn_block()
    points[8:, 0] += 1e-11
    with pytest.raises(InvalidInputError, match="8 of 16 nodes coincide"):
        BodyMesh(points, cells)
    points[8:, 0] += 1e-8
    assert BodyMesh(points, cells).n_nodes == 16


def test_a_crack_is_accepted_when_asked_for_also_after_splitting() -> None:
    points, cells = torn_block()
    mesh = BodyMesh(points, cells, coincident_nodes=True)
    assert boundary_faces(mesh.cells)[0].shape[0] == 12
    assert split_hexahedra(mesh).n_nodes == 16


def test_coincident_nodes_are_merged() -> None:
    points, cells = torn_block()
    merged, joined, new = merge_duplicate_nodes(points, cells)
    mesh = BodyMesh(merged, joined)
    assert (mesh.n_nodes, mesh.n_cells, mesh.volume) == (12, 2, pytest.approx(2.0))
    assert boundary_faces(mesh.cells)[0].shape[0] == 10
    assert np.array_equal(merged[new], points)


def test_a_mesh_without_coincident_nodes_is_left_as_it_is() -> None:
    mesh = rectangle((0, 0), (2, 1), (3, 2), "triangle")
    points, cells, new = merge_duplicate_nodes(mesh.points, mesh.cells)
    assert np.array_equal(points, mesh.points)
    assert np.array_equal(cells, mesh.cells)
    assert np.array_equal(new, np.arange(mesh.n_nodes))


def test_a_tolerance_larger_than_a_cell_is_refused() -> None:
    mesh = rectangle((0, 0), (2, 1), (2, 1))
    with pytest.raises(InvalidInputError, match=r"2 of 2 do not, first cell 0: lower the tolerance of 0\.5"):
        merge_duplicate_nodes(mesh.points, mesh.cells, tolerance=0.5)


@given(st.integers(0, 2**32 - 1))
def test_a_mesh_torn_into_its_cells_is_put_together_again(seed: int) -> None:
    mesh = rectangle((0, 0), (4, 3), (4, 3))
    torn = mesh.points[mesh.cells].reshape(-1, 2)
    order = np.random.default_rng(seed).permutation(len(torn))  # nodes come in any order
    cells = np.argsort(order).reshape(-1, 4)
    points, joined, new = merge_duplicate_nodes(torn[order], cells)
    assert points.shape == mesh.points.shape
    assert np.array_equal(points[joined], mesh.points[mesh.cells])
    assert np.all(np.diff(np.unique(new, return_index=True)[1]) > 0), "the old order is kept"
