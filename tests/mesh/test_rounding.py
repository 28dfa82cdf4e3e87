"""Meshes are judged and cut alike in any unit and at any distance from the origin, or refused."""

from __future__ import annotations

import numpy as np
import pytest

from fenics_contact import BodyMesh
from fenics_contact.errors import InvalidInputError
from fenics_contact.gallery import block
from fenics_contact.mesh import bisection_partition, merge_duplicate_nodes
from fenics_contact.mesh.plane import flattened

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
