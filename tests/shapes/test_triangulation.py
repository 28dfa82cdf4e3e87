"""Bodies of triangles: distances with the right sign, normals between triangles, and what is no body."""

from __future__ import annotations

import numpy as np
import pytest

from fenics_contact.errors import InvalidInputError
from fenics_contact.shapes import Box, Sphere, Triangulation
from fenics_contact.shapes.triangles import TriangleTree, closest_in_triangles
from tests.shapes.bodies import CUBE, SIDES, ball
from tests.shapes.curvatures import principal_curvatures


def around(count: int = 2000, size: float = 1.6) -> np.ndarray:
    return np.random.default_rng(5).uniform(-size, size, (count, 3))


def test_a_cube_of_triangles_is_the_box() -> None:
    cube, box, x = Triangulation(CUBE, SIDES), Box((0.5, 0.5, 0.5), (1, 1, 1)), around()
    np.testing.assert_allclose(cube.distance(x), box.distance(x), atol=1e-14)
    outside = x[box.distance(x) > 1e-3]
    np.testing.assert_allclose(cube.normals(outside), box.normals(outside), atol=1e-12)
    np.testing.assert_allclose(cube.curvatures(outside), box.curvatures(outside), atol=1e-9)


def test_the_sign_is_right_at_edges_and_corners_that_point_in() -> None:
    """An L of three cubes has an edge that points in; nearest triangles alone give either sign there."""
    points = np.array([(x, y, z) for z in (0.0, 1.0) for x, y in
                       [(0, 0), (2, 0), (2, 1), (1, 1), (1, 2), (0, 2)]])  # fmt: skip
    fan = [(0, 1, 2), (0, 2, 3), (0, 3, 4), (0, 4, 5)]
    floor, top = [(a, c, b) for a, b, c in fan], [(a + 6, b + 6, c + 6) for a, b, c in fan]
    wall = [t for k in range(6) for n in [(k + 1) % 6] for t in ((k, n, k + 6), (n, n + 6, k + 6))]
    body = Triangulation(points, np.array([*floor, *top, *wall]))
    x = 2.0 * np.random.default_rng(1).uniform(-0.5, 1.5, (4000, 3)) * np.array([1, 1, 0.5])
    wide = (x[:, :2] > 0).all(axis=1) & (x[:, :2] < 2).all(axis=1) & (x[:, 2] > 0) & (x[:, 2] < 1)
    inside = wide & (x[:, :2] < 1).any(axis=1)
    assert 300 < inside.sum() < 3000
    np.testing.assert_array_equal(body.distance(x) < 0, inside)


def test_the_sign_is_right_at_edges_sharper_than_a_right_angle() -> None:
    """Beyond such an edge points lie behind one of its triangles: only their mean normal has the sign."""
    tip = np.array([[0, -1, 0.05], [0, 1, 0.05], [0, 1, -0.05], [0, -1, -0.05], [2, -1, 0], [2, 1, 0]])
    sides = [[0, 4, 1], [4, 5, 1], [3, 2, 4], [4, 2, 5], [0, 1, 3], [1, 2, 3], [0, 3, 4], [1, 5, 2]]
    blade = Triangulation(tip, np.array(sides))
    x = np.random.default_rng(3).uniform(-1.0, 1.0, (4000, 3)) * np.array([0.3, 0.9, 0.3]) + np.array(
        [2.0, 0, 0]
    )
    inside = (x[:, 0] < 2.0) & (np.abs(x[:, 2]) < 0.05 * (1.0 - x[:, 0] / 2.0))
    assert 5 < inside.sum() < 1000
    np.testing.assert_array_equal(blade.distance(x) < 0, inside)


def test_the_closest_triangle_is_that_of_all() -> None:
    points, triangles = ball(300)
    corners = points[triangles] * np.array([1.0, 0.05, 3.0])  # slivers
    x = around(300, 3.0)
    pairs = np.repeat(np.arange(len(x)), len(corners)), np.tile(np.arange(len(corners)), len(x))
    place = closest_in_triangles(x[pairs[0]], corners[pairs[1]])[1]
    every = np.linalg.norm(x[pairs[0]] - place, axis=1).reshape(len(x), -1).min(axis=1)
    found = TriangleTree(corners).closest(x)
    np.testing.assert_allclose(np.linalg.norm(x - found.point, axis=1), every, rtol=1e-13)


def test_a_fine_ball_of_triangles_is_the_ball_to_the_error_of_its_facets() -> None:
    x = around()
    x = x[np.abs(np.linalg.norm(x, axis=1) - 1.0) < 0.4]
    errors = []
    for count in (500, 2000):
        body, true = Triangulation(*ball(count)), Sphere((0.0, 0.0, 0.0), 1.0)
        edges = body.points[body.triangles] - body.points[np.roll(body.triangles, 1, axis=1)]
        sagitta = np.linalg.norm(edges, axis=2).max() ** 2 / 6.0  # height over the middle of a triangle
        errors.append(
            (
                np.abs(body.distance(x) - true.distance(x)).max(),
                np.abs(body.normals(x) - true.normals(x)).max(),
                np.abs(principal_curvatures(body, true.normals(x)) - 1.0).mean(),
            )
        )
        assert errors[-1][0] < sagitta
    distance, normal, bend = np.array(errors[0]) / np.array(errors[1])
    assert distance > 3.5  # h²
    assert normal > 1.8  # h, of interpolated normals
    assert bend > 0.9
    assert errors[1][2] < 0.3


def test_interpolated_normals_are_continuous_where_facets_are_not() -> None:
    """Along a line over many edges the normal of a facet jumps by degrees, an interpolated one does not."""
    points, triangles = ball(500)
    angle = np.linspace(0.3, 1.3, 2001)
    line = 1.02 * np.column_stack([np.cos(angle), 0.3 + 0.0 * angle, np.sin(angle)]) / np.hypot(1.0, 0.3)
    jumps = [
        np.abs(np.diff(Triangulation(points, triangles, smooth).normals(line * scale), axis=0)).max()
        for smooth, scale in ((np.pi / 6, 1.0), (0.0, 0.97))
    ]
    assert jumps[0] < 5e-3
    assert jumps[1] > 5e-2


def test_equal_points_are_merged_and_triangles_without_area_dropped() -> None:
    apart = CUBE[SIDES].reshape(-1, 3) * (1.0 + 3e-8 * np.random.default_rng(0).normal(size=(36, 3)))
    loose = np.vstack([np.arange(36).reshape(-1, 3), [[0, 0, 1]]])
    body = Triangulation(apart, loose)
    assert len(body.points) == 8
    assert len(body.triangles) == 12
    assert body._facts()["sharp edges"] == 12


def test_a_hole_inside_faces_the_other_way() -> None:
    inner = 0.25 + 0.5 * CUBE
    hollow = Triangulation(np.vstack([CUBE, inner]), np.vstack([SIDES, 8 + SIDES[:, ::-1]]))
    np.testing.assert_allclose(hollow.distance(np.array([[0.5] * 3, [0.1, 0.5, 0.5]])), [0.25, -0.1])


@pytest.mark.parametrize(
    ("points", "triangles", "message"),
    [
        (CUBE, SIDES[1:], r"must be closed, got 3 open edges of 18, one at \(.*\): close"),
        (CUBE, np.vstack([SIDES, [[0, 3, 7]]]), r"must be closed, got .* of more than two triangles"),
        (CUBE, SIDES[:, ::-1], r"must face outwards, got 12 around a volume of -1: exchange two corners"),
        (
            np.vstack([CUBE, CUBE + 3.0]), np.vstack([SIDES, 8 + SIDES[:, ::-1]]),
            r"must face outwards, got 12 around a volume of -1",
        ),
        (
            CUBE, np.vstack([SIDES[:1, ::-1], SIDES[1:]]),
            r"triangles must be counterclockwise seen from outside, got 3 edges",
        ),
        (CUBE[:, :2], SIDES, r"needs finite points \(n, 3\) .* got shapes \(8, 2\) and \(12, 3\)"),
        (CUBE, SIDES + 1, r"needs finite points"),
    ],
)  # fmt: skip
def test_what_is_no_body_is_refused(points: np.ndarray, triangles: np.ndarray, message: str) -> None:
    with pytest.raises(InvalidInputError, match=message):
        Triangulation(points, triangles)


def test_an_angle_of_round_surfaces_is_an_angle() -> None:
    with pytest.raises(InvalidInputError, match=r"smooth must be an angle from 0 to π in radians, got 30"):
        Triangulation(CUBE, SIDES, 30.0)
