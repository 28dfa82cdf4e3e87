"""Triangles and quadrilaterals: boundary, areas, quality, partition, builders."""

from __future__ import annotations

import numpy as np
import pytest

from fenics_contact import BodyMesh, box_partition
from fenics_contact.errors import InvalidInputError
from fenics_contact.gallery import block, half_disc, rectangle, rectangle_lattice
from fenics_contact.gallery.blocks import split_hexahedra, split_quadrilaterals, structured_cells
from fenics_contact.mesh import bisection_partition, boundary_faces, scaled_jacobian
from fenics_contact.mesh.cell_types import CELL_TYPES, QUADRILATERAL
from fenics_contact.mesh.faces import cell_faces, neighbours, orient, vector_areas
from fenics_contact.mesh.partition import check_face_connected
from fenics_contact.mesh.quality import jacobian_ratio, jacobians, volume
from tests.mesh.counts import torn_node_counts

CELLS = ["quadrilateral", "triangle"]
NORMALS = {"x0": [-3, 0], "x1": [3, 0], "y0": [0, -2], "y1": [0, 2]}
"""Outward normal times length of the sides of a rectangle of size 2 x 3."""


def shaken(cell: str) -> tuple[np.ndarray, np.ndarray]:
    """A rectangle whose nodes are all moved a little."""
    mesh = rectangle((0, 0), (4, 3), (4, 3), cell)
    return mesh.points + np.random.default_rng(1).uniform(-0.1, 0.1, mesh.points.shape), mesh.cells


@pytest.mark.parametrize("cell", CELLS)
def test_a_rectangle_is_described_as_plane(cell: str) -> None:
    mesh = rectangle((1, 1), (3, 4), (2, 3), cell)
    assert (mesh.dim, mesh.cell_type, mesh.n_nodes) == (2, cell, 12)
    assert mesh.n_cells == (6 if cell == "quadrilateral" else 12)
    assert mesh.volume == pytest.approx(6.0)
    assert block((0, 0, 0), (1, 1, 1), (1, 1, 1)).dim == 3


@pytest.mark.parametrize("cell", CELLS)
def test_the_sides_of_a_rectangle_are_complete_and_face_outwards(cell: str) -> None:
    mesh = rectangle((1, 1), (3, 4), (2, 3), cell)
    assert set(mesh.surfaces) == set(NORMALS)
    for name, facets in mesh.surfaces.items():
        assert facets.shape == ({"x": 3, "y": 2}[name[0]], 2)
        assert np.ptp(mesh.points[facets][:, :, "xy".index(name[0])]) == 0.0
        assert vector_areas(mesh.points, facets).sum(axis=0) == pytest.approx(NORMALS[name])


@pytest.mark.parametrize("cell", CELLS)
def test_the_grid_index_is_the_place_in_the_rectangle(cell: str) -> None:
    mesh = rectangle((0, 0), (2, 3), (2, 3), cell)
    assert mesh.grid is not None
    assert np.array_equal(mesh.grid, np.floor(mesh.points[mesh.cells].mean(axis=1)))


@pytest.mark.parametrize("cell", CELLS)
def test_the_body_lies_to_the_left_of_its_edges(cell: str) -> None:
    points, cells = shaken(cell)
    edges = cell_faces(cells, dim=2)
    normals = vector_areas(points, edges.reshape(-1, 2)).reshape(*edges.shape[:2], 2)
    outward = points[edges].mean(axis=2) - points[cells].mean(axis=1, keepdims=True)
    assert np.sum(normals * outward, axis=-1).min() > 0.0


@pytest.mark.parametrize("cell", CELLS)
def test_the_boundary_is_one_closed_line_run_through_counter_clockwise(cell: str) -> None:
    points, cells = shaken(cell)
    edges, owner = boundary_faces(cells, dim=2)
    assert edges.shape == (14, 2)
    assert np.array_equal(np.sort(edges[:, 0]), np.sort(edges[:, 1]))
    assert all(set(edge) <= set(cells[c]) for edge, c in zip(edges.tolist(), owner, strict=True))
    a, b = points[edges].transpose(1, 2, 0)
    assert 0.5 * np.sum(a[0] * b[1] - a[1] * b[0]) == pytest.approx(volume(points, cells))
    assert vector_areas(points, edges).sum(axis=0) == pytest.approx(np.zeros(2), abs=1e-12)


def test_every_inner_edge_makes_a_pair_of_neighbours() -> None:
    mesh = rectangle((0, 0), (4, 3), (4, 3))
    assert neighbours(mesh.cells, dim=2).shape[0] == 3 * 3 + 4 * 2
    assert neighbours(rectangle((0, 0), (4, 3), (4, 3), "triangle").cells, dim=2).shape[0] == 17 + 12


def test_edges_in_the_wrong_direction_are_refused_and_turned() -> None:
    mesh = rectangle((0, 0), (2, 1), (2, 1))
    backwards = mesh.surfaces["y0"][:, ::-1]
    with pytest.raises(InvalidInputError, match=r"'low' .* 2 of 2 do not.* `orient\(cells, facets, dim=2\)`"):
        BodyMesh(mesh.points, mesh.cells, {"low": backwards})
    assert np.array_equal(orient(mesh.cells, backwards, dim=2), mesh.surfaces["y0"])


def test_the_jacobian_is_the_derivative_of_the_bilinear_map() -> None:
    points, cells = shaken("quadrilateral")

    def image(position: np.ndarray) -> np.ndarray:
        weights = np.prod(np.where(QUADRILATERAL.vertices == 1.0, position, 1.0 - position), axis=1)
        return np.asarray(weights @ points[cells])

    position, h = np.array([0.3, 0.8]), 1e-5
    columns = [(image(position + h * e) - image(position - h * e)) / (2 * h) for e in np.eye(2)]
    expected = np.linalg.det(np.stack(columns, axis=-1))
    assert jacobians(points, cells, position[None])[:, 0] == pytest.approx(expected, rel=1e-8)


@pytest.mark.parametrize("cell", CELLS)
def test_a_mirrored_plane_cell_has_negative_quality_and_is_refused(cell: str) -> None:
    points, cells = shaken(cell)
    mirrored = points * [1.0, -1.0]
    assert scaled_jacobian(points, cells).min() > 0.0
    assert jacobian_ratio(points, cells).min() > 0.0
    assert scaled_jacobian(mirrored, cells).max() < 0.0
    assert volume(mirrored, cells) == pytest.approx(-volume(points, cells))
    with pytest.raises(
        InvalidInputError, match=rf"{len(cells)} of {len(cells)} are inverted or flat; .* at \("
    ):
        BodyMesh(mirrored, cells)


def test_a_quadrilateral_that_is_not_convex_is_refused() -> None:
    points = np.array([[0.0, 0.0], [1.0, 0.0], [0.2, 0.2], [0.0, 1.0]])
    with pytest.raises(InvalidInputError, match="1 of 1 are inverted"):
        BodyMesh(points, np.arange(4)[None])


def test_regular_cells_have_the_best_quality_there_is() -> None:
    square = rectangle((0, 0), (1, 1), (1, 1))
    assert scaled_jacobian(square.points, square.cells) == pytest.approx([1.0])
    regular = np.array([[0.0, 0.0], [1.0, 0.0], [0.5, np.sqrt(0.75)]])
    assert scaled_jacobian(regular, np.arange(3)[None]) == pytest.approx([1.0])


@pytest.mark.parametrize("name", CELL_TYPES)
def test_the_reference_cell_has_its_volume_and_faces_outwards(name: str) -> None:
    cell = CELL_TYPES[name]
    alone = np.arange(cell.nodes.shape[0])[None]
    assert volume(cell.nodes, alone) == pytest.approx(cell.reference_volume)
    areas = vector_areas(cell.nodes, cell.faces)
    outward = cell.nodes[cell.faces].mean(axis=1) - cell.nodes.mean(axis=0)
    assert np.sum(areas * outward, axis=1).min() > 0.0
    assert areas.sum(axis=0) == pytest.approx(np.zeros(cell.dim), abs=1e-15)
    assert scaled_jacobian(cell.nodes, alone)[0] > 0.5


def test_triangles_of_three_coordinates_are_no_solid() -> None:
    mesh = rectangle((0, 0), (1, 1), (1, 1), "triangle")
    with pytest.raises(
        InvalidInputError, match=r"cells in 3 dimensions .* got \(2, 3\): dim=2 is for a plane"
    ):
        boundary_faces(mesh.cells)
    with pytest.raises(InvalidInputError, match="dim must be 2 or 3, got 1"):
        boundary_faces(mesh.cells, dim=1)


def test_mirrored_quadrilaterals_are_split_along_the_other_diagonal() -> None:
    mesh = rectangle((0, 0), (2, 2), (2, 2))
    assert mesh.grid is not None
    split = split_quadrilaterals(mesh, mesh.grid.sum(axis=1) == 1)
    assert split.volume == pytest.approx(4.0)
    middle = np.flatnonzero(np.all(split.points == 1.0, axis=1))
    assert np.count_nonzero(np.any(split.cells == middle, axis=1)) == 8
    assert scaled_jacobian(split.points, split.cells).min() > 0.8


def test_only_the_right_cells_are_split() -> None:
    with pytest.raises(InvalidInputError, match="needs quadrilaterals, got cells of type triangle"):
        split_quadrilaterals(rectangle((0, 0), (1, 1), (1, 1), "triangle"))
    with pytest.raises(InvalidInputError, match="needs hexahedra, got cells of type quadrilateral"):
        split_hexahedra(rectangle((0, 0), (1, 1), (1, 1)))


def test_lines_may_be_spaced_as_one_likes() -> None:
    mesh = rectangle_lattice([np.array([0.0, 1.0, 4.0]), np.array([0.0, 2.0])])
    assert sorted(np.unique(mesh.points[:, 0])) == [0.0, 1.0, 4.0]
    assert mesh.volume == pytest.approx(8.0)


@pytest.mark.parametrize(
    ("arguments", "message"),
    [
        (((0, 0), (0, 1), (1, 1)), r"upper must exceed lower in x and y, got lower \[0, 0\]"),
        (((0, 0), (1, 1), (1, 1, 1)), r"counts must be two integers, got \(1, 1, 1\)"),
        (((0, 0), (1, 1), (1, 0)), r"counts\[1\] must be an integer of at least 1, got 0"),
        (((0, 0), (1, 1), (1, 1), "quadrilateral9"), "quadratic makes quadratic cells of them"),
        (((0, 0), (1, 1), (1, 1), "tetrahedron"), r"cell must be one of .*triangle.*, got 'tetrahedron'"),
    ],
)
def test_what_is_no_rectangle_is_refused(arguments: tuple[object, ...], message: str) -> None:
    with pytest.raises(InvalidInputError, match=message):
        rectangle(*arguments)  # type: ignore[arg-type]


@pytest.mark.parametrize("cell", CELLS)
def test_plane_bodies_are_cut_into_connected_subdomains(cell: str) -> None:
    mesh = rectangle((0, 0), (4, 6), (4, 6), cell)
    boxes = box_partition(mesh, (2, 3))
    assert torn_node_counts(mesh, boxes).tolist() == 6 * [9]
    check_face_connected(mesh, boxes)
    cut = bisection_partition(mesh, 5)
    check_face_connected(mesh, cut)
    assert np.unique(cut).tolist() == [0, 1, 2, 3, 4]


def test_pieces_that_meet_in_a_node_only_are_found() -> None:
    mesh = rectangle((0, 0), (2, 2), (2, 2))
    with pytest.raises(InvalidInputError, match="2 of 2 are not, first subdomain 0 in 2 pieces"):
        check_face_connected(mesh, np.array([0, 1, 1, 0]))


def test_three_numbers_are_no_plane_box() -> None:
    with pytest.raises(InvalidInputError, match=r"boxes must be two integers, .*got \(1, 1, 1\)"):
        box_partition(rectangle((0, 0), (1, 1), (1, 1)), (1, 1, 1))


@pytest.mark.parametrize("symmetry", ["x", ""])
def test_a_half_disc_is_round_rests_on_the_origin_and_has_good_cells(symmetry: str) -> None:
    mesh = half_disc(2.0, 6, symmetry=symmetry)
    assert set(mesh.surfaces) == {"contact", "side", "top"} | ({"x0"} if symmetry else set())
    for name in ("contact", "side"):
        assert np.linalg.norm(mesh.points[mesh.surfaces[name]] - [0.0, 2.0], axis=-1) == pytest.approx(2.0)
    assert np.flatnonzero(mesh.points[:, 1] == mesh.points[:, 1].min()).size == 1
    assert mesh.points[np.argmin(mesh.points[:, 1])] == pytest.approx([0.0, 0.0], abs=1e-15)
    assert np.abs(mesh.points[mesh.surfaces["contact"], 0]).max() == pytest.approx(np.sqrt(2.0))
    assert np.all(mesh.points[mesh.surfaces["top"], 1] == 2.0)
    named = np.concatenate(list(mesh.surfaces.values()))
    facets, _ = boundary_faces(mesh.cells, dim=2)
    assert np.unique(np.sort(named, axis=1), axis=0).shape == named.shape == facets.shape
    assert scaled_jacobian(mesh.points, mesh.cells).min() > 0.5
    whole = np.pi * 2.0 if not symmetry else np.pi
    coarse, fine = (1.0 - half_disc(2.0, n, symmetry=symmetry).volume / whole for n in (6, 12))
    assert np.log2(coarse / fine) == pytest.approx(2.0, abs=0.25)


def test_a_closed_lattice_of_two_directions_is_a_ring() -> None:
    cells, grid = structured_cells((6, 1), closed=True)
    angle = np.repeat(np.arange(6) * np.pi / 3.0, 2)
    radius = np.tile([2.0, 1.0], 6)  # inwards: counter-clockwise cells
    ring = BodyMesh(radius[:, None] * np.column_stack([np.cos(angle), np.sin(angle)]), cells, grid=grid)
    assert (ring.n_nodes, ring.n_cells) == (12, 6)
    assert ring.volume == pytest.approx(0.5 * 6 * np.sin(np.pi / 3.0) * (4.0 - 1.0))
    assert boundary_faces(ring.cells, dim=2)[0].shape == (12, 2)
