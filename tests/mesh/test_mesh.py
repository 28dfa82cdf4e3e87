"""A body mesh is checked when it is made, and says what is wrong with it."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest

from fenics_contact import BodyMesh
from fenics_contact.errors import InvalidInputError
from fenics_contact.gallery import block
from fenics_contact.mesh import boundary_faces
from fenics_contact.mesh.cell_types import HEXAHEDRON
from fenics_contact.mesh.quality import jacobians


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
        InvalidInputError, match=rf"must be finite and below .*, 1 of 12 are not, first node 5 at .*{value}"
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
    with pytest.raises(InvalidInputError, match=r"cells must be integers, got float64: convert"):
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
    with pytest.raises(InvalidInputError, match=r"1 of 2 are inverted.* worst is cell 1 .* of -1: list the"):
        BodyMesh(**parts)


def test_a_flat_cell_is_refused(parts: dict[str, Any]) -> None:
    parts["points"][:, 2] = 0.0
    with pytest.raises(InvalidInputError, match="2 of 2 are inverted or flat"):
        BodyMesh(**parts)


def test_a_cell_that_is_inverted_only_between_its_vertices_is_refused() -> None:
    points = HEXAHEDRON.vertices.copy()
    points[[3, 6, 7]] += [[0.0, 0.0, 1.0], [0.5, 1.0, -0.5], [1.0, -0.5, 0.0]]
    cells = np.arange(8)[None]
    assert jacobians(points, cells, HEXAHEDRON.vertices).min() == pytest.approx(0.25)
    with pytest.raises(InvalidInputError, match="1 of 1 are inverted"):
        BodyMesh(points, cells)


def test_a_facet_inside_the_body_is_refused(parts: dict[str, Any]) -> None:
    inner = np.flatnonzero(parts["points"][:, 0] == 1.0)
    parts["surfaces"]["middle"] = inner[None, [0, 1, 3, 2]]
    with pytest.raises(InvalidInputError, match=r"surface 'middle' must consist of boundary faces .*1 of 1"):
        BodyMesh(**parts)


def test_a_facet_that_faces_inwards_is_refused(parts: dict[str, Any]) -> None:
    parts["surfaces"]["z1"] = parts["surfaces"]["z1"][:, ::-1]
    with pytest.raises(
        InvalidInputError, match=r"surface 'z1' .* pointing out of the body, 2 of 2 facets do"
    ):
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
        InvalidInputError, match=r"surface 'odd' must have shape \(n_facets, 4\) with at least"
    ):
        BodyMesh(**parts)


def test_a_grid_of_another_length_is_refused(parts: dict[str, Any]) -> None:
    parts["grid"] = parts["grid"][:1]
    with pytest.raises(InvalidInputError, match=r"grid must have shape \(2, 3\).* got shape \(1, 3\)"):
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
        InvalidInputError, match=r"1 of 2 are inverted .* is cell 1 at \(0\.75, .* of -1: move the nodes less"
    ):
        mesh.moved(points)


def test_a_motion_by_nan_is_refused(parts: dict[str, Any]) -> None:
    mesh = BodyMesh(**parts)
    with pytest.raises(InvalidInputError, match="12 of 12 are not, first node 0"):
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
    with pytest.raises(InvalidInputError, match=r"20 nodes are not supported, as .* pulls .* in_vtk_order"):
        BodyMesh(points, np.arange(20)[None])
