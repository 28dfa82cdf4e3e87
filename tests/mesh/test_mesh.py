"""Meshes of bodies: faces, quality, regions, coincident nodes and rounding."""

from __future__ import annotations

from dataclasses import replace
from typing import Any

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from scipy.spatial import cKDTree

from fenics_contact import BodyMesh
from fenics_contact.errors import InvalidInputError
from fenics_contact.gallery import LinkShape, block, rectangle, two_links
from fenics_contact.gallery.blocks import split_hexahedra, split_quadrilaterals
from fenics_contact.mesh import (
    bisection_partition,
    boundary_faces,
    merge_duplicate_nodes,
    quadratic,
    scaled_jacobian,
)
from fenics_contact.mesh.cell_types import HEXAHEDRON
from fenics_contact.mesh.faces import cell_faces, match_faces, neighbours, number_faces, orient, vector_areas
from fenics_contact.mesh.near_surfaces import near_surfaces
from fenics_contact.mesh.plane import flattened
from fenics_contact.mesh.quality import cell_volumes, jacobian_ratio, jacobians, volume
from fenics_contact.shapes import Circle, Plane, SurfaceShape
from fenics_contact.shapes.combined import Joined
from tests.readers.mesh_files import area


@pytest.fixture
def parts() -> dict[str, Any]:
    """Arrays of a sound mesh of two hexahedra, free to be spoilt."""
    mesh = block((0, 0, 0), (2, 1, 1), (2, 1, 1))
    return {
        "points": mesh.points.copy(),
        "cells": mesh.cells.copy(),
        "surfaces": {name: facets.copy() for name, facets in mesh.surfaces.items()},
        "grid": None if mesh.grid is None else mesh.grid.copy(),
    }


def test_sound_arrays_are_accepted_and_described(parts: dict[str, Any]) -> None:
    mesh = BodyMesh(**parts)
    assert (mesh.cell_type, mesh.n_nodes, mesh.n_cells) == ("hexahedron", 12, 2)
    assert mesh.volume == pytest.approx(2.0)


def test_the_arrays_belong_to_the_mesh_and_cannot_be_written(parts: dict[str, Any]) -> None:
    mesh = BodyMesh(**parts)
    parts["points"][0] = 7.0
    assert mesh.points[0, 0] == 0.0
    for array in (mesh.points, mesh.cells, mesh.grid, mesh.surfaces["x0"]):
        assert array is not None
        with pytest.raises(ValueError, match="read-only"):
            array[0] = 0


def test_points_of_another_shape_are_refused(parts: dict[str, Any]) -> None:
    parts["points"] = parts["points"][:, :1]
    needed = r"points must have shape \(n_nodes, 3\) or \(n_nodes, 2\), got \(12, 1\)"
    with pytest.raises(InvalidInputError, match=needed):
        BodyMesh(**parts)


def test_hexahedra_in_two_dimensions_are_refused(parts: dict[str, Any]) -> None:
    parts["points"] = parts["points"][:, :2]
    needed = (
        r"cells in 2 dimensions .* \(n_cells, 3\) for triangles or \(n_cells, 4\) for quad.* got \(2, 8\)"
    )
    with pytest.raises(InvalidInputError, match=needed):
        BodyMesh(**parts)


@pytest.mark.parametrize("value", [np.nan, np.inf])
def test_a_coordinate_that_is_not_finite_is_named(parts: dict[str, Any], value: float) -> None:
    parts["points"][5, 1] = value
    with pytest.raises(
        InvalidInputError,
        match=rf"must have finite coordinates below .*, 1 of 12 do not, first node 5 at .*{value}",
    ):
        BodyMesh(**parts)


def test_cells_of_another_shape_are_refused(parts: dict[str, Any]) -> None:
    parts["cells"] = parts["cells"][:, :6]
    with pytest.raises(InvalidInputError, match=r"\(n_cells, 8\) for hexahedra or .*, got \(2, 6\)"):
        BodyMesh(**parts)


def test_no_cells_at_all_are_refused(parts: dict[str, Any]) -> None:
    parts["cells"] = parts["cells"][:0]
    with pytest.raises(InvalidInputError, match="at least one cell, got none: give"):
        BodyMesh(**parts)


def test_node_numbers_that_are_no_integers_are_refused(parts: dict[str, Any]) -> None:
    parts["cells"] = parts["cells"].astype(float)
    with pytest.raises(InvalidInputError, match=r"cells must be integers, got float64: use"):
        BodyMesh(**parts)


@pytest.mark.parametrize("number", [-1, 12])
def test_a_node_number_out_of_range_is_refused(parts: dict[str, Any], number: int) -> None:
    parts["cells"][0, 0] = number
    with pytest.raises(InvalidInputError, match=rf"cells must number nodes 0 to 11, got .*{number}"):
        BodyMesh(**parts)


def test_a_node_without_a_cell_is_refused(parts: dict[str, Any]) -> None:
    parts["points"] = np.vstack([parts["points"], [5.0, 5.0, 5.0]])
    with pytest.raises(InvalidInputError, match="1 of 13 do not, first node 12: remove them"):
        BodyMesh(**parts)


def test_an_inverted_cell_is_refused_with_its_ratio(parts: dict[str, Any]) -> None:
    parts["cells"][1] = parts["cells"][1, [4, 5, 6, 7, 0, 1, 2, 3]]
    with pytest.raises(
        InvalidInputError, match=r"1 of 2 are inverted.* worst is cell 1 .* ratio -1: list the"
    ):
        BodyMesh(**parts)


def test_a_flat_cell_is_refused(parts: dict[str, Any]) -> None:
    parts["points"][:, 2] = 0.0
    with pytest.raises(InvalidInputError, match="2 of 2 are inverted or flat"):
        BodyMesh(**parts)


def test_a_cell_that_is_inverted_only_between_its_vertices_is_reported(
    caplog: pytest.LogCaptureFixture,
) -> None:
    """Where it is integrated it is as it should be; what moves or refines meshes makes none of its kind."""
    points = HEXAHEDRON.vertices.copy()
    points[[3, 6, 7]] += [[0.0, 0.0, 1.0], [0.5, 1.0, -0.5], [1.0, -0.5, 0.0]]
    cells = np.arange(8)[None]
    assert jacobians(points, cells, HEXAHEDRON.vertices).min() == pytest.approx(0.25)
    mesh = BodyMesh(points, cells)
    assert "1 cells are turned inside out at a corner or an edge, the worst around (" in caplog.text
    with pytest.raises(InvalidInputError, match="1 of 1 are inverted"):
        mesh.moved(points + 1.0)
    points[6] = [0.1, 0.1, 0.1]
    with pytest.raises(InvalidInputError, match="1 of 1 are inverted"):
        BodyMesh(points, cells)


@pytest.mark.parametrize("dim", [2, 3])
def test_parallelepipeds_have_the_jacobians_that_they_have_beside_bent_cells(dim: int) -> None:
    """Alone they take one determinant each, beside others those of every place."""
    mesh = rectangle((0, 0), (2, 3), (3, 2)) if dim == 2 else block((0, 0, 0), (2, 3, 1), (3, 2, 2))
    points = mesh.points @ np.array([[1.0, 0.3, 0.2], [-0.4, 2.0, 0.1], [0.3, 0.0, 1.5]])[:dim, :dim] + 7.0
    alone = jacobians(points, mesh.cells)
    assert np.ptp(alone) == 0.0 or np.ptp(alone) < 1e-13 * alone.max()
    points[mesh.cells[-1, -2]] += 0.1
    beside = jacobians(points, mesh.cells)
    untouched = ~(mesh.cells == mesh.cells[-1, -2]).any(axis=1)
    assert untouched.any()
    np.testing.assert_allclose(beside[untouched], alone[untouched], rtol=1e-13)
    assert np.ptp(beside[-1]) > 1e-2 * beside[-1].max()


def test_a_facet_inside_the_body_is_refused(parts: dict[str, Any]) -> None:
    inner = np.flatnonzero(parts["points"][:, 0] == 1.0)
    parts["surfaces"]["middle"] = inner[None, [0, 1, 3, 2]]
    with pytest.raises(InvalidInputError, match=r"surface 'middle' must consist of boundary faces .*1 of 1"):
        BodyMesh(**parts)


def test_a_facet_that_faces_inwards_is_refused(parts: dict[str, Any]) -> None:
    parts["surfaces"]["z1"] = parts["surfaces"]["z1"][:, ::-1]
    with pytest.raises(InvalidInputError, match=r"surface 'z1' .* pointing out of the body, 2 of 2 do not"):
        BodyMesh(**parts)


def test_a_facet_whose_nodes_cross_is_refused(parts: dict[str, Any]) -> None:
    parts["surfaces"]["z1"] = parts["surfaces"]["z1"][:, [0, 2, 1, 3]]
    with pytest.raises(InvalidInputError, match=r"surface 'z1' must list nodes around each facet"):
        BodyMesh(**parts)


def test_a_facet_may_start_at_any_of_its_nodes(parts: dict[str, Any]) -> None:
    parts["surfaces"]["z1"] = np.roll(parts["surfaces"]["z1"], 2, axis=1)
    assert BodyMesh(**parts).surfaces["z1"].shape == (2, 4)


@pytest.mark.parametrize("start", [0, 1, 3])
def test_a_facet_that_is_listed_twice_is_refused(parts: dict[str, Any], start: int) -> None:
    """Its area would count twice, and a total force over it be halved."""
    facets = parts["surfaces"]["z1"]
    parts["surfaces"]["z1"] = np.vstack([facets, np.roll(facets[:1], start, axis=1)])
    message = r"'z1' must list every facet once, 1 of 2 are listed more often.*: keep one of each"
    with pytest.raises(InvalidInputError, match=message):
        BodyMesh(**parts)


def test_a_facet_that_repeats_a_node_is_refused(parts: dict[str, Any]) -> None:
    facets = parts["surfaces"]["z1"]
    parts["surfaces"]["z1"] = np.vstack([facets, facets[:1, [0, 1, 2, 2]]])
    with pytest.raises(InvalidInputError, match="'z1' must consist of boundary faces of the cells, 1 of"):
        BodyMesh(**parts)


@pytest.mark.parametrize("facets", [np.zeros((0, 4), dtype=int), np.zeros((1, 3), dtype=int)])
def test_an_empty_surface_and_one_of_triangles_are_refused(parts: dict[str, Any], facets: np.ndarray) -> None:
    parts["surfaces"]["odd"] = facets
    with pytest.raises(
        InvalidInputError, match=r"surface 'odd' must have shape \(n ≥ 1, 4\), a row per facet"
    ):
        BodyMesh(**parts)


def test_a_grid_of_another_length_is_refused(parts: dict[str, Any]) -> None:
    parts["grid"] = parts["grid"][:1]
    with pytest.raises(InvalidInputError, match=r"grid must have shape \(2, 3\).* got \(1, 3\)"):
        BodyMesh(**parts)


def test_a_moved_mesh_keeps_its_topology_and_leaves_the_original(parts: dict[str, Any]) -> None:
    mesh = BodyMesh(**parts)
    moved = mesh.moved(2.0 * mesh.points)
    assert (mesh.volume, moved.volume) == (pytest.approx(2.0), pytest.approx(16.0))
    assert moved.cells is mesh.cells
    assert moved.surfaces is mesh.surfaces


def test_a_motion_that_inverts_a_cell_is_refused_with_count_cell_and_ratio(parts: dict[str, Any]) -> None:
    mesh = BodyMesh(**parts)
    points = mesh.points.copy()
    points[points[:, 0] == 2.0, 0] = 0.5
    with pytest.raises(
        InvalidInputError,
        match=r"1 of 2 are inverted .* is cell 1 at \(0\.75, .* ratio -1: move the nodes less",
    ):
        mesh.moved(points)


def test_a_motion_by_nan_is_refused(parts: dict[str, Any]) -> None:
    mesh = BodyMesh(**parts)
    with pytest.raises(InvalidInputError, match="12 of 12 do not, first node 0"):
        mesh.moved(np.nan * mesh.points)


def test_a_motion_of_other_nodes_is_refused(parts: dict[str, Any]) -> None:
    mesh = BodyMesh(**parts)
    with pytest.raises(InvalidInputError, match=r"points must have shape \(12, 3\), got \(11, 3\)"):
        mesh.moved(mesh.points[1:])


def test_a_mesh_needs_no_surfaces_and_no_grid() -> None:
    mesh = block((0, 0, 0), (1, 1, 1), (1, 1, 1))
    plain = BodyMesh(mesh.points, mesh.cells)
    assert (dict(plain.surfaces), plain.grid) == ({}, None)
    assert boundary_faces(plain.cells)[0].shape == (6, 4)


def test_hexahedra_without_centres_are_refused_with_the_reason() -> None:
    points = np.random.default_rng(0).random((20, 3))
    with pytest.raises(InvalidInputError, match=r"20 nodes are those of 27 .* in_vtk_order.* serendipity"):
        BodyMesh(points, np.arange(20)[None])


# Faces are found, matched and oriented; volumes and Jacobians agree with what is known of them.
CELLS = ["hexahedron", "tetrahedron"]
RNG = np.random.default_rng(5)


def shaken(cell: str) -> tuple[np.ndarray, np.ndarray]:
    """A block whose inner and outer nodes are all moved a little."""
    mesh = block((0, 0, 0), (3, 2, 2), (3, 2, 2), cell)
    return mesh.points + np.random.default_rng(1).uniform(-0.1, 0.1, mesh.points.shape), mesh.cells


@pytest.mark.parametrize("cell", CELLS)
def test_local_faces_point_out_of_their_cell(cell: str) -> None:
    points, cells = shaken(cell)
    faces = cell_faces(cells)
    areas = vector_areas(points, faces.reshape(-1, faces.shape[2])).reshape(*faces.shape[:2], 3)
    outward = points[faces].mean(axis=2) - points[cells].mean(axis=1, keepdims=True)
    assert np.sum(areas * outward, axis=-1).min() > 0.0


@pytest.mark.parametrize("cell", CELLS)
def test_the_boundary_is_watertight(cell: str) -> None:
    points, cells = shaken(cell)
    facets, _ = boundary_faces(cells)
    edges = np.stack([facets, np.roll(facets, -1, axis=1)], axis=-1).reshape(-1, 2)
    there = {tuple(edge) for edge in edges.tolist()}
    assert len(there) == edges.shape[0], "an edge is run through twice in the same direction"
    assert there == {(b, a) for a, b in there}, "an edge is not met from the other side"
    assert vector_areas(points, facets).sum(axis=0) == pytest.approx(np.zeros(3), abs=1e-12)


def test_the_boundary_knows_its_cells() -> None:
    mesh = block((0, 0, 0), (1, 1, 1), (3, 3, 3))
    facets, owner = boundary_faces(mesh.cells)
    assert facets.shape == (54, 4)
    assert all(set(facet) <= set(mesh.cells[cell]) for facet, cell in zip(facets, owner, strict=True))
    assert 13 not in owner, "the cell in the middle has no free face"


def test_every_inner_face_makes_a_pair_of_neighbours() -> None:
    mesh = block((0, 0, 0), (1, 1, 1), (4, 3, 2))
    pairs = neighbours(mesh.cells)
    assert pairs.shape[0] == 3 * 3 * 2 + 4 * 2 * 2 + 4 * 3 * 1
    assert mesh.grid is not None
    assert np.all(np.abs(mesh.grid[pairs[:, 0]] - mesh.grid[pairs[:, 1]]).sum(axis=1) == 1)


def test_a_face_of_three_cells_is_refused() -> None:
    cells = block((0, 0, 0), (1, 1, 1), (2, 1, 1)).cells
    with pytest.raises(InvalidInputError, match=r"at most 2 cells may share a face, 3 share"):
        neighbours(np.vstack([cells, cells[:1]]))


def test_equal_faces_get_equal_numbers_whatever_their_order() -> None:
    faces = np.array([[7, 3, 1, 9], [1, 3, 7, 8], [9, 1, 7, 3], [2**30, 3, 1, 9]])
    numbers = number_faces(faces)
    assert numbers[0] == numbers[2]
    assert sorted(set(numbers.tolist())) == [0, 1, 2]


def test_a_face_is_found_among_others_or_not_at_all() -> None:
    faces = np.array([[4, 5, 6], [1, 2, 9]])
    assert match_faces(faces, np.array([[0, 1, 2], [6, 4, 5]])).tolist() == [1, -1]


@pytest.mark.parametrize("cell", CELLS)
def test_shuffled_facets_are_turned_outwards(cell: str) -> None:
    mesh = block((0, 0, 0), (3, 2, 2), (3, 2, 2), cell)
    facets = mesh.surfaces["y1"]
    oriented = orient(mesh.cells, RNG.permuted(facets, axis=1))
    assert vector_areas(mesh.points, oriented).sum(axis=0) == pytest.approx([0.0, 6.0, 0.0])


def test_a_facet_that_is_no_boundary_face_is_refused() -> None:
    mesh = block((0, 0, 0), (1, 1, 1), (1, 1, 1))
    with pytest.raises(InvalidInputError, match=r"1 of 2 do not, first facet 1 with nodes \[0, 1, 2, 5\]"):
        orient(mesh.cells, np.vstack([mesh.surfaces["x0"][:1], [[0, 1, 2, 5]]]))


def test_the_jacobian_is_the_derivative_of_the_trilinear_map() -> None:
    points, cells = shaken("hexahedron")

    def image(position: np.ndarray) -> np.ndarray:
        weights = np.prod(np.where(HEXAHEDRON.vertices == 1.0, position, 1.0 - position), axis=1)
        return np.asarray(weights @ points[cells])

    position, h = np.array([0.3, 0.8, 0.1]), 1e-5
    columns = [(image(position + h * e) - image(position - h * e)) / (2 * h) for e in np.eye(3)]
    expected = np.linalg.det(np.stack(columns, axis=-1))
    assert jacobians(points, cells, position[None])[:, 0] == pytest.approx(expected, rel=1e-8)


@pytest.mark.parametrize("cell", CELLS)
def test_the_volume_agrees_with_the_divergence_theorem(cell: str) -> None:
    points, cells = shaken(cell)
    facets, _ = boundary_faces(cells)
    corners = points[facets]
    if cell == "tetrahedron":
        flux = np.sum(corners.mean(axis=1) * vector_areas(points, facets), axis=1)
    else:  # bilinear facets: 2 x 2 Gauss points integrate the quadratic-by-quadratic flux exactly
        flux = np.zeros(facets.shape[0])
        for u in (0.5 - 0.5 / np.sqrt(3), 0.5 + 0.5 / np.sqrt(3)):
            for v in (0.5 - 0.5 / np.sqrt(3), 0.5 + 0.5 / np.sqrt(3)):
                a, b, c, d = corners.transpose(1, 0, 2)
                x = (1 - u) * (1 - v) * a + u * (1 - v) * b + u * v * c + (1 - u) * v * d
                x_u = (1 - v) * (b - a) + v * (c - d)
                x_v = (1 - u) * (d - a) + u * (c - b)
                flux += 0.25 * np.sum(x * np.cross(x_u, x_v), axis=1)
    assert volume(points, cells) == pytest.approx(flux.sum() / 3.0, rel=1e-13)


def test_a_box_has_the_best_quality_there_is() -> None:
    mesh = block((0, 0, 0), (1, 2, 3), (1, 1, 1))
    assert scaled_jacobian(mesh.points, mesh.cells) == pytest.approx([1.0])
    assert jacobian_ratio(mesh.points, mesh.cells) == pytest.approx([1.0])
    assert cell_volumes(mesh.points, mesh.cells) == pytest.approx([6.0])


def test_a_regular_tetrahedron_has_the_best_quality_there_is() -> None:
    points = np.array([[1.0, 1, 1], [1, -1, -1], [-1, 1, -1], [-1, -1, 1]])
    cells = np.array([[0, 2, 1, 3]])
    assert jacobians(points, cells)[0, 0] > 0.0
    assert scaled_jacobian(points, cells) == pytest.approx([1.0])
    assert scaled_jacobian(points, cells[:, [1, 0, 2, 3]]) == pytest.approx([-1.0])


@pytest.mark.parametrize("cell", CELLS)
def test_a_mirrored_cell_has_negative_quality(cell: str) -> None:
    points, cells = shaken(cell)
    mirrored = points * [1.0, 1.0, -1.0]
    assert scaled_jacobian(points, cells).min() > 0.0
    assert scaled_jacobian(mirrored, cells).max() < 0.0
    assert jacobian_ratio(mirrored, cells).max() < 0.0
    assert volume(mirrored, cells) == pytest.approx(-volume(points, cells))


# Regions share a body out among themselves; nodes at the same place are found, refused or joined.
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
        ({"a": [0, 1, 2], "b": [2, 3]}, "1 of 'b' in it twice or in others, first 2"),
        ({"a": [0, 1, 1, 2, 3]}, "1 of 'a' in it twice or .* first 1"),
        ({"a": [0], "b": [3]}, "2 of 4 do not, first cell 1: give the rest a region"),
        ({"a": [0, 1, 2, 3], "b": np.zeros(0, dtype=int)}, "region 'b' .* got none: omit it if empty"),
        ({"a": [0, 1, 2, 4]}, "region 'a' must hold cell numbers below 4, got 0 to 4"),
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


# Meshes are judged and cut alike in any unit and at any distance from the origin, or refused.
WAY = np.array([1.0, 0.3, -0.6])


def placed(mesh: BodyMesh, size: float, shift: float) -> BodyMesh:
    return mesh.moved(size * (mesh.points + shift * WAY))


@pytest.mark.parametrize("size", [1e-13, 1e-6, 1.0, 1e9])
@pytest.mark.parametrize("shift", [0.0, 1e4, 1e7])
def test_bisection_cuts_a_body_alike_wherever_it_lies(size: float, shift: float) -> None:
    mesh = block((0.0, 0.0, 0.0), (2.1, 1.1, 0.7), (7, 5, 3))
    for parts in (3, 5):
        found = bisection_partition(placed(mesh, size, shift), parts)
        np.testing.assert_array_equal(found, bisection_partition(mesh, parts))


@pytest.mark.parametrize("shift", [0.0, 1e4, 1e7])
def test_nodes_at_one_place_are_found_although_rounding_parts_them(shift: float) -> None:
    first = block((0.0, 0.0, 0.0), (0.7, 1.1, 1.3), (3, 5, 7))
    random = np.random.default_rng(0)
    points = first.points[first.cells.ravel()] + shift * WAY  # torn into its cells
    points += np.finfo(float).eps * np.abs(points) * random.integers(-1, 2, points.shape)
    cells = np.arange(len(points)).reshape(first.cells.shape)
    with pytest.raises(InvalidInputError, match="nodes coincide with another"):
        BodyMesh(points, cells)
    merged, _, _ = merge_duplicate_nodes(points, cells)
    assert len(merged) == first.n_nodes


def test_a_flat_cell_is_found_far_from_the_origin() -> None:
    mesh = block((0.0, 0.0, 0.0), (0.7, 1.1, 1.3), (3, 3, 3))
    points = mesh.points + 1e7 * WAY
    points[:, 2] = points[0, 2] + np.where(mesh.points[:, 2] > 0.5, 1.0, 0.0)
    with pytest.raises(InvalidInputError, match="18 of 27 are inverted or flat"):
        mesh.moved(points)


def test_a_body_so_far_away_that_its_cells_are_rounded_is_refused() -> None:
    mesh = block((0.0, 0.0, 0.0), (0.7, 1.1, 1.3), (3, 3, 3))
    placed(mesh, 1.0, 1e9)
    for shift in (1e12, 1e14):
        with pytest.raises(
            InvalidInputError, match=r"coordinates must resolve the cells.*: move all bodies nearer"
        ):
            placed(mesh, 1.0, shift)


def test_a_plane_mesh_far_away_in_z_is_flat_although_rounding_lifts_its_nodes() -> None:
    points = np.random.default_rng(1).uniform(0.0, 1.0, (20, 3))
    points[:, 2] = 1e7 * (1.0 + np.finfo(float).eps * (np.arange(20) % 3))
    assert np.ptp(points[:, 2]) > 1e-10
    assert flattened(points, np.arange(20), "a test").shape == (20, 2)


# Shapes must face out of the body, and show themselves in a few lines.
def ring() -> BodyMesh:
    """A quarter of a ring with radii 1 and 2."""
    flat = rectangle((1.0, 0.0), (2.0, 0.5 * np.pi), (2, 8))
    radius, angle = flat.points.T
    return replace(flat, points=radius[:, None] * np.column_stack([np.cos(angle), np.sin(angle)]))


@pytest.mark.parametrize("surface", ["x0", "x1"])
def test_a_circle_that_faces_into_the_body_is_refused_with_the_switch_to_turn_it(surface: str) -> None:
    hole = surface == "x0"
    radius = 1.0 if hole else 2.0
    ring().with_shapes({surface: Circle((0.0, 0.0), radius, hollow=hole)})
    with pytest.raises(InvalidInputError, match=f"points into the body: give it hollow={hole}"):
        ring().with_shapes({surface: Circle((0.0, 0.0), radius, hollow=not hole)})


def joined(mesh: BodyMesh, sides: dict[str, SurfaceShape]) -> Joined:
    return Joined(tuple(sides.values()), tuple(mesh.points[mesh.surfaces[name]] for name in sides))


def test_one_side_of_several_that_faces_into_the_body_is_refused() -> None:
    mesh = block((0, 0, 0), (1, 1, 1), (2, 2, 2))
    both = {"two": np.concatenate([mesh.surfaces["x1"], mesh.surfaces["z1"]])}
    mesh = BodyMesh(mesh.points, mesh.cells, {**mesh.surfaces, **both})
    right = {"x1": Plane((1, 0, 0), (1, 0, 0)), "z1": Plane((0, 0, 1), (0, 0, 1))}
    known = mesh.with_shapes({"two": joined(mesh, right)})
    assert repr(known.shapes["two"]) == "Joined\n  shapes  2 × Plane\n  facets  8"
    assert len(str(known.shapes).splitlines()) <= 10
    wrong = joined(mesh, right | {"z1": Plane((0, 0, 1), (0, 0, -1))})
    with pytest.raises(InvalidInputError, match=r"points into the body: give it the normal \(.*1\.0\)"):
        mesh.with_shapes({"two": wrong})


# Facets that face another body are found, and no others.
def centres(mesh: BodyMesh, surface: str) -> np.ndarray:
    """Return the centres of facets, (n, dim)."""
    return np.asarray(mesh.points[mesh.surfaces[surface][:, :4]].mean(axis=1))


@pytest.mark.parametrize("cell", ["hexahedron", "tetrahedron"])
def test_blocks_on_each_other_are_near_where_they_face_each_other(cell: str) -> None:
    meshes = {
        "table": block((0, 0, 0), (4, 2, 1), (8, 4, 2), cell),
        "tool": block((1, 0, 1.01), (2, 2, 2), (3, 5, 3), cell),
        "far": block((1, 0, 2.5), (2, 2, 3), (2, 2, 2), cell),
    }
    found, pairs = near_surfaces(meshes, 0.05)
    assert pairs == [("table", "tool")]
    assert area(found["tool"], "near table") == [0.0, 0.0, -2.0]
    table = centres(found["table"], "near tool")
    assert area(found["table"], "near tool")[2] == pytest.approx(2.0, abs=1.01)
    np.testing.assert_allclose(table[:, 2], 1.0)
    assert table[:, 0].min() > 0.4
    assert table[:, 0].max() < 2.6
    assert set(found["far"].surfaces) == set(meshes["far"].surfaces)
    assert "near tool" not in meshes["table"].surfaces
    assert near_surfaces(meshes, 0.005)[1] == []


def test_a_small_body_beside_the_centre_of_a_large_facet_is_near_it() -> None:
    meshes = {
        "plate": block((0, 0, 0), (4, 4, 1), (1, 1, 1)),
        "pin": block((0.1, 0.1, 1), (0.5, 0.5, 2), (2, 2, 2)),
    }
    found, pairs = near_surfaces(meshes, 0.01)
    assert pairs == [("plate", "pin")]
    assert area(found["plate"], "near pin") == [0.0, 0.0, 16.0]
    assert area(found["pin"], "near plate") == [0.0, 0.0, -0.16]


def test_plane_and_quadratic_bodies_are_looked_at_by_their_corners() -> None:
    plane = {"low": rectangle((0, 0), (2, 1), (4, 2)), "high": rectangle((0, 1), (2, 2), (3, 2), "triangle")}
    found, pairs = near_surfaces(plane, 1e-6)
    assert pairs == [("low", "high")]
    assert area(found["low"], "near high") == [0.0, 2.0]
    bent = {
        name: quadratic(block((0, 0, z), (1, 1, z + 1), (2, 2, 1))) for name, z in (("low", 0), ("high", 1))
    }
    found, _ = near_surfaces(bent, 1e-6)
    assert found["high"].surfaces["near low"].shape == (4, 9)


def test_links_of_a_chain_are_near_in_their_crowns() -> None:
    links = two_links(LinkShape(n_around=24, n_a=4, n_b=8))
    found, pairs = near_surfaces({"one": links.first.mesh, "two": links.second.mesh}, 0.5)
    assert pairs == [("one", "two")]
    for name, other in (("one", "two"), ("two", "one")):
        mesh, near = found[name], f"near {other}"
        apart, _ = cKDTree(found[other].points).query(mesh.points)
        size = np.linalg.norm(np.ptp(mesh.points[mesh.surfaces[near]], axis=1), axis=1).max()
        inside = np.unique(mesh.surfaces[near])
        assert np.argmin(apart) in inside
        assert 4 < len(inside) < mesh.n_nodes / 8
        assert apart[inside].max() < 0.5 + 1.5 * size


def test_what_cannot_be_searched_is_refused() -> None:
    meshes = {"low": block((0, 0, 0), (1, 1, 1), (1, 1, 1)), "high": block((0, 0, 1), (1, 1, 2), (1, 1, 1))}
    with pytest.raises(InvalidInputError, match="distance must be positive and finite, got 0: give"):
        near_surfaces(meshes, 0)
    with pytest.raises(InvalidInputError, match="body 'low' must have no surface 'near high' yet"):
        near_surfaces(near_surfaces(meshes, 0.1)[0], 0.1)


@pytest.mark.parametrize("corners", [2, 3, 4])
def test_faces_have_the_same_numbers_however_large_those_of_nodes_are(corners: int) -> None:
    faces = np.argsort(np.random.default_rng(0).random((400, 7)), axis=1)[:, :corners]
    numbers = number_faces(faces)
    assert numbers.max() + 1 == len({tuple(sorted(face)) for face in faces.tolist()}) < 400
    for far in (2**21 - 4, 2**21, 2**30):  # one integer for a triangle, beyond that two
        np.testing.assert_array_equal(number_faces(faces + far), numbers)
