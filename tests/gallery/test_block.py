"""Blocks, extrusions and bolted bodies of the gallery."""

from __future__ import annotations

import numpy as np
import pytest

from fenics_contact import BodyMesh
from fenics_contact.errors import InvalidInputError
from fenics_contact.gallery import (
    block,
    bolt,
    box_lattice,
    drilled_plate,
    growing_ticks,
    half_disc,
    hemisphere,
    rectangle,
    side_of,
)
from fenics_contact.gallery.blocks import extrude, split_hexahedra
from fenics_contact.mesh import quadratic, scaled_jacobian
from fenics_contact.mesh.faces import vector_areas
from fenics_contact.mesh.partition import check_one_piece

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
        with pytest.raises(InvalidInputError, match=r"ratio > 1 are needed, got .*or use linspace"):
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
    with pytest.raises(InvalidInputError, match="must be split alike, their diagonals do not meet"):
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


# Solids swept from plane meshes.
HEIGHTS = [0.0, 0.5, 2.0]


def size(mesh: BodyMesh, name: str) -> np.ndarray:
    return vector_areas(mesh.points, mesh.surfaces[name]).sum(axis=0)


def test_a_swept_rectangle_is_a_block() -> None:
    swept = extrude(rectangle((0, 0), (3, 1), (3, 2)), HEIGHTS)
    like = block((0, 0, 0), (3, 1, 2), (3, 2, 2))
    assert (swept.n_nodes, swept.n_cells) == (like.n_nodes, like.n_cells)
    assert swept.volume == pytest.approx(6.0)
    assert set(swept.surfaces) == {"bottom", "top", "x0", "x1", "y0", "y1"}
    for ours, theirs in {"bottom": "z0", "top": "z1", "x0": "x0", "x1": "x1", "y0": "y0", "y1": "y1"}.items():
        assert size(swept, ours) == pytest.approx(size(like, theirs))


def test_cells_that_are_left_out_leave_steps() -> None:
    section = rectangle((0, 0), (2, 1), (2, 1))
    stair = extrude(section, HEIGHTS, present=[[True, True], [True, False]])
    assert stair.volume == pytest.approx(0.5 * 2 + 1.5)
    assert stair.n_nodes == 6 + 6 + 4
    assert size(stair, "top") == pytest.approx([0, 0, 2])
    assert set(np.unique(stair.points[stair.surfaces["top"]][..., 2])) == {0.5, 2.0}
    assert size(stair, "x1") == pytest.approx([0.5, 0, 0]), "the step is no part of the swept edge"


def test_regions_are_swept_and_empty_ones_dropped() -> None:
    plane = rectangle((0, 0), (2, 1), (2, 1))
    section = BodyMesh(plane.points, plane.cells, {}, None, {"left": [0], "right": [1]})
    both = extrude(section, HEIGHTS)
    assert {name: cells.tolist() for name, cells in both.regions.items()} == {"left": [0, 2], "right": [1, 3]}
    one = extrude(section, HEIGHTS, present=[[True, False]] * 2)
    assert {name: cells.tolist() for name, cells in one.regions.items()} == {"left": [0, 1]}


def test_a_section_of_triangles_is_refused() -> None:
    with pytest.raises(InvalidInputError, match="extrude needs quadrilaterals, got cells of type triangle"):
        extrude(rectangle((0, 0), (1, 1), (1, 1), "triangle"), HEIGHTS)


@pytest.mark.parametrize("heights", [[0.0], [0.0, 1.0, 1.0], [[0.0, 1.0]], [0.0, np.nan]])
def test_heights_that_do_not_ascend_are_refused(heights: list[float]) -> None:
    with pytest.raises(InvalidInputError, match="heights must be at least two ascending numbers, got"):
        extrude(rectangle((0, 0), (1, 1), (1, 1)), heights)


@pytest.mark.parametrize("present", [[[True]], [[False, False]] * 2])
def test_presence_of_another_shape_or_of_nothing_is_refused(present: list[list[bool]]) -> None:
    with pytest.raises(InvalidInputError, match=r"present must have shape \(2, 2\) \(layers, cells\)"):
        extrude(rectangle((0, 0), (2, 1), (2, 1)), HEIGHTS, present=present)


# Plates with a hole and bolts, cut in half.
BOLTED_HEIGHTS = [-2.0, 0.0, 2.0]


def area(mesh: BodyMesh, name: str) -> float:
    return float(np.linalg.norm(vector_areas(mesh.points, mesh.surfaces[name]), axis=1).sum())


def boundary_is_named_once(mesh: BodyMesh) -> bool:
    facets = np.concatenate(list(mesh.surfaces.values()))
    total = vector_areas(mesh.points, facets).sum(axis=0)
    return len(np.unique(np.sort(facets, axis=1), axis=0)) == len(facets) and bool(np.allclose(total, 0))


def test_a_drilled_plate_has_the_volume_and_the_sides_of_the_formula() -> None:
    plate = drilled_plate(1.0, 4.0, (-4.0, 10.0), BOLTED_HEIGHTS, 8)
    check_one_piece(plate)
    assert plate.volume == pytest.approx(4 * (14 * 4 - np.pi / 2), rel=1e-3)
    assert boundary_is_named_once(plate)
    sizes = {"x0": 16, "x1": 16, "y1": 56, "y0": 4 * 12, "top": 14 * 4 - np.pi / 2, "hole": 4 * np.pi}
    for name, expected in sizes.items():
        assert area(plate, name) == pytest.approx(expected, rel=3e-3)


def test_nodes_of_the_hole_lie_on_its_circle() -> None:
    plate = drilled_plate(1.0, 4.0, (-6.0, 4.0), BOLTED_HEIGHTS, 3, n_radial=5)
    nodes = plate.points[np.unique(plate.surfaces["hole"])]
    assert np.hypot(*nodes[:, :2].T) == pytest.approx(np.ones(len(nodes)))
    assert len(nodes) == 3 * 13


def test_plates_to_both_sides_match_where_they_overlap() -> None:
    one = drilled_plate(1.0, 4.0, (-4.0, 10.0), BOLTED_HEIGHTS, 3)
    other = drilled_plate(1.0, 4.0, (-12.0, 4.0), BOLTED_HEIGHTS, 3)
    near = [np.round(m.points[np.abs(m.points[:, 0]) < 4 + 1e-9], 9) + 0.0 for m in (one, other)]
    assert len(near[0]) > 50
    assert {tuple(p) for p in near[0]} == {tuple(p) for p in near[1]}


def test_a_bolt_has_the_volume_and_the_bearing_faces_of_the_formula() -> None:
    screw = bolt(1.0, 2.0, (-3.0, 3.0), 1.5, 8, n_radial=3)
    check_one_piece(screw)
    assert screw.volume == pytest.approx(np.pi / 2 * (6 + 2 * 4 * 1.5), rel=3e-3)
    assert boundary_is_named_once(screw)
    ring, disc = np.pi / 2 * 3, np.pi / 2 * 4
    sizes = {
        "head": ring,
        "nut": ring,
        "top": disc,
        "bottom": disc,
        "shank": np.pi * 6,
        "side": 2 * np.pi * 3,
    }
    for name, expected in {**sizes, "y0": 2 * 6 + 2 * 4 * 1.5}.items():
        assert area(screw, name) == pytest.approx(expected, rel=5e-3)
    for name, z in {"head": 3.0, "nut": -3.0, "top": 4.5, "bottom": -4.5}.items():
        assert screw.points[screw.surfaces[name]][..., 2] == pytest.approx(z)


def test_the_regions_of_a_bolt_are_what_is_clamped_and_its_ends() -> None:
    screw = bolt(1.0, 2.0, (-3.0, 3.0), 1.5, 2, layers=(3, 1))
    z = screw.points[screw.cells][..., 2].mean(axis=1)
    assert np.abs(z[screw.regions["shank"]]).max() < 3.0
    assert np.abs(z[screw.regions["ends"]]).min() > 3.0


@pytest.mark.parametrize("sizes", [(4.0, 4.0, (-4.0, 4.0)), (1.0, 4.0, (-3.0, 4.0)), (0.0, 4.0, (-4.0, 4.0))])
def test_a_plate_whose_sizes_do_not_fit_is_refused(sizes: tuple[float, float, tuple[float, float]]) -> None:
    with pytest.raises(InvalidInputError, match="0 < hole < half_width < ends are needed, got"):
        drilled_plate(*sizes, BOLTED_HEIGHTS, 2)


@pytest.mark.parametrize(
    "sizes", [(2.0, 2.0, (-3, 3), 1.0), (1.0, 2.0, (3, -3), 1.0), (1.0, 2.0, (-3, 3), 0.0)]
)
def test_a_bolt_whose_sizes_do_not_fit_is_refused(
    sizes: tuple[float, float, tuple[float, float], float],
) -> None:
    with pytest.raises(
        InvalidInputError, match="0 < shank < head, an ascending grip and head_height > 0 are needed"
    ):
        bolt(*sizes, 2)


def test_counts_that_are_no_positive_integers_are_refused() -> None:
    with pytest.raises(InvalidInputError, match="n_radial must be an integer of at least 1, got 0"):
        drilled_plate(1.0, 4.0, (-4.0, 4.0), BOLTED_HEIGHTS, 2, n_radial=0)
    with pytest.raises(InvalidInputError, match=r"layers\[1\] must be an integer of at least 1, got 0"):
        bolt(1.0, 2.0, (-3.0, 3.0), 1.0, 2, layers=(2, 0))


# Sides of structured meshes that a design may move by name.
BOX = block((0.0, 0.0, 0.0), (4.0, 2.0, 1.0), (8, 4, 2))


@pytest.mark.parametrize("cell", ["hexahedron", "tetrahedron"])
@pytest.mark.parametrize(
    ("name", "axis", "counts"), [("z1", 2, (9, 5)), ("x0", 0, (5, 3)), ("y1", 1, (9, 3))]
)
def test_a_side_of_a_block_is_a_grid(cell: str, name: str, axis: int, counts: tuple[int, int]) -> None:
    mesh = block((0.0, 0.0, 0.0), (4.0, 2.0, 1.0), (8, 4, 2), cell)
    side = side_of(mesh, name)
    assert side.counts == counts
    np.testing.assert_array_equal(np.sort(side.nodes), np.unique(mesh.surfaces[name]))
    outward = np.zeros(3)
    outward[axis] = 1.0 if name.endswith("1") else -1.0
    np.testing.assert_allclose(side.directions, np.tile(outward, (len(side.nodes), 1)), atol=1e-14)
    places = np.delete(mesh.points[side.nodes], axis, axis=1)
    np.testing.assert_allclose(side.parameters, places / places.max(axis=0), atol=1e-14)
    first = side.parameters[:, 0].reshape(counts)
    assert np.ptp(first, axis=1).max() < 1e-12
    assert np.all(np.diff(first[:, 0]) > 0.0)


def test_nodes_of_a_bent_side_move_along_its_normals() -> None:
    points = BOX.points.copy()
    points[:, 2] += 0.1 * points[:, 0] * points[:, 2]
    side = side_of(BOX.moved(points), "z1")
    np.testing.assert_allclose(
        side.directions, np.tile([-0.1, 0.0, 1.0] / np.sqrt(1.01), (45, 1)), atol=1e-12
    )


def without_a_facet() -> BodyMesh:
    return BodyMesh(BOX.points, BOX.cells, {"z1": BOX.surfaces["z1"][[0, 5]]})


def roof() -> BodyMesh:
    points = BOX.points.copy()
    points[:, 2] += 2.0 * np.abs(points[:, 0] - 2.0)
    return BOX.moved(points)


@pytest.mark.parametrize(
    ("mesh", "name"),
    [
        (BOX, "top"), (without_a_facet(), "z1"),
        (hemisphere(1.0, 4), "contact"), (roof(), "z1"),
    ],
    ids=["no such surface", "two facets apart", "ball", "roof"],
)  # fmt: skip
def test_what_is_no_grid_is_refused_with_what_is_needed(mesh: BodyMesh, name: str) -> None:
    with pytest.raises(InvalidInputError, match=rf"rectangular grid along x, y or z, got '{name}' of"):
        side_of(mesh, name)


@pytest.mark.parametrize("cell", ["hexahedron", "tetrahedron"])
def test_a_side_of_quadratic_cells_is_a_grid_of_twice_as_many(cell: str) -> None:
    mesh = quadratic(block((0.0, 0.0, 0.0), (4.0, 2.0, 1.0), (4, 2, 1), cell))
    side = side_of(mesh, "z1")
    assert side.counts == (9, 5)
    np.testing.assert_array_equal(np.sort(side.nodes), np.unique(mesh.surfaces["z1"]))
    np.testing.assert_allclose(side.parameters * (4.0, 2.0), mesh.points[side.nodes, :2], atol=1e-14)


@pytest.mark.parametrize("order", [1, 2])
def test_a_curve_runs_by_its_length_with_the_body_on_its_left(order: int) -> None:
    mesh = half_disc(2.0, 4, symmetry="", grading=0.0)
    arc = side_of(quadratic(mesh) if order == 2 else mesh, "contact")
    mesh = quadratic(mesh) if order == 2 else mesh
    points = mesh.points[arc.nodes]
    assert arc.counts == (len(arc.nodes),) == (8 * order + 1,)
    assert len(np.unique(arc.nodes)) == len(arc.nodes)
    angle = np.arctan2(points[:, 0], 2.0 - points[:, 1])
    assert np.all(np.diff(angle) > 0.0), "from left to right below the disc"
    np.testing.assert_allclose(arc.parameters[:, 0], (angle - angle[0]) / np.ptp(angle), atol=5e-3)
    outward = (points - (0.0, 2.0)) / 2.0
    np.testing.assert_allclose(arc.directions[1:-1], outward[1:-1], atol=2e-2)
    np.testing.assert_allclose(np.linalg.norm(arc.directions, axis=1), 1.0)


def ring() -> BodyMesh:
    """A square with a square hole, whose edge is closed."""
    mesh = rectangle((0.0, 0.0), (3.0, 3.0), (3, 3))
    cells = np.delete(mesh.cells, 4, axis=0)
    hole = mesh.cells[4][[0, 3, 2, 1]]
    return BodyMesh(mesh.points, cells, {"hole": np.column_stack([hole, np.roll(hole, -1)])})


def in_two_pieces() -> BodyMesh:
    mesh = rectangle((0.0, 0.0), (3.0, 1.0), (3, 1))
    return BodyMesh(
        mesh.points, mesh.cells, {"ends": np.concatenate([mesh.surfaces["x0"], mesh.surfaces["x1"]])}
    )


@pytest.mark.parametrize(
    ("mesh", "name"),
    [(ring(), "hole"), (in_two_pieces(), "ends"), (ring(), "edge")],
    ids=["closed", "two pieces", "none"],
)
def test_what_is_no_curve_with_two_ends_is_refused(mesh: BodyMesh, name: str) -> None:
    with pytest.raises(
        InvalidInputError, match=rf"needs a curve in one piece with two ends, got '{name}' of"
    ):
        side_of(mesh, name)
