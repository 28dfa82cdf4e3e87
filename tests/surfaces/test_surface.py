"""Curves around plane bodies: outward normals, lengths, local coordinates; and what makes no surface."""

from __future__ import annotations

import numpy as np
import pytest

from fenics_contact._surfaces.facets import (
    FacetedSurface,
    edge_distance,
    faceted_surface,
    outside,
    quadrature_areas,
    shape_functions,
)
from fenics_contact.errors import InvalidInputError


def disc(n: int, radius: float = 2.0) -> FacetedSurface:
    """The rim of a disc, counterclockwise, its nodes numbered among others."""
    angle = 2 * np.pi * np.arange(n) / n
    points = np.full((2 * n, 2), 99.0)
    points[1::2] = radius * np.column_stack([np.cos(angle), np.sin(angle)])
    numbers = 2 * np.arange(n) + 1
    return faceted_surface(points, np.column_stack([numbers, np.roll(numbers, -1)]))


def test_the_normals_of_a_disc_point_outwards() -> None:
    rim = disc(12)
    assert (rim.corners, rim.dim) == (2, 2)
    np.testing.assert_array_equal(rim.nodes, 2 * np.arange(12) + 1)
    np.testing.assert_allclose(rim.normals, rim.points / 2.0, atol=1e-14)


def test_nodal_lengths_add_up_to_the_curve() -> None:
    ticks = np.array([0.0, 1.0, 4.0])
    line = faceted_surface(np.column_stack([3 * ticks, 4 * ticks]), np.array([[0, 1], [1, 2]]))
    np.testing.assert_allclose(line.areas, [2.5, 10.0, 7.5])
    np.testing.assert_allclose(quadrature_areas(line.points, line.facets), [5.0, 15.0])
    np.testing.assert_allclose(line.normals, np.tile([0.8, -0.6], (3, 1)))


def test_long_edges_weigh_more_in_the_normal_of_a_corner() -> None:
    bent = faceted_surface(np.array([[0.0, 1], [0, 0], [3, 0]]), np.array([[0, 1], [1, 2]]))
    np.testing.assert_allclose(bent.normals[1], np.array([-1.0, -3.0]) / np.sqrt(10))


def test_shape_functions_of_edges_interpolate_linearly() -> None:
    local = np.array([[-1.0], [0.5], [1.0]])
    values, slopes = shape_functions(local, 2)
    np.testing.assert_allclose(values, [[1, 0], [0.25, 0.75], [0, 1]])
    np.testing.assert_allclose(slopes, np.tile([[[-0.5], [0.5]]], (3, 1, 1)))


def test_local_coordinates_tell_how_far_outside_or_inside_an_edge_a_point_lies() -> None:
    local = np.array([[-1.5], [-0.25], [1.0], [2.0]])
    np.testing.assert_allclose(outside(local, 2), [0.5, 0, 0, 1])
    np.testing.assert_allclose(edge_distance(local[1:3], 2), [0.75, 0])


@pytest.mark.parametrize(("corners", "dim"), [(2, 3), (3, 2), (4, 2), (6, 3)])
def test_facets_of_another_dimension_make_no_surface(corners: int, dim: int) -> None:
    with pytest.raises(InvalidInputError, match=f"{corners} corners and points with {dim} coordinates"):
        faceted_surface(np.eye(6, dim), np.arange(corners)[None])
