"""Clipped polygons are the intersections that half-planes give; local coordinates and rules are exact."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import assume, given
from hypothesis import strategies as st
from scipy.optimize import linprog
from scipy.spatial import ConvexHull, HalfspaceIntersection

from fenics_contact._pairing.mortar.cells import clip, simplices
from fenics_contact._pairing.mortar.planes import local_coordinates, measure, rule
from fenics_contact._surfaces.facets import facet_shape_values

#: Coordinates that often coincide, so that corners meet corners and edges meet edges, and any others.
coordinate = st.one_of(st.integers(-4, 4).map(lambda k: k / 4), st.floats(-1, 1))
point = st.tuples(coordinate, coordinate)
area_of = measure


def convex(corners: int) -> st.SearchStrategy[np.ndarray]:
    """Convex polygons, counterclockwise, as images of a regular one and triangles of any three points."""
    if corners == 3:
        return (
            st.tuples(point, point, point).map(np.array).filter(lambda p: abs(doubled(p)) > 0.05).map(ordered)
        )
    return st.tuples(point, point, point, point).map(np.array).filter(is_convex).map(ordered)


def doubled(p: np.ndarray) -> float:
    return float(2 * measure(p[None])[0])


def ordered(p: np.ndarray) -> np.ndarray:
    return p if doubled(p) > 0 else p[::-1]


def is_convex(p: np.ndarray) -> bool:
    turned = [doubled(p[[i, (i + 1) % 4, (i + 2) % 4]]) for i in range(4)]
    return min(turned) > 0.02 or max(turned) < -0.02


def half_planes(p: np.ndarray) -> np.ndarray:
    """Rows (a, b, c) with a x + b y + c ≤ 0 inside."""
    along = np.roll(p, -1, axis=0) - p
    outward = np.column_stack([along[:, 1], -along[:, 0]]) / np.linalg.norm(along, axis=1)[:, None]
    return np.column_stack([outward, -(outward * p).sum(axis=1)])


def intersection_area(p: np.ndarray, q: np.ndarray) -> float:
    """Area of the intersection by half-planes around the centre of its largest circle."""
    planes = np.vstack([half_planes(p), half_planes(q)])
    rows = np.column_stack([planes[:, :2], np.ones(len(planes))])
    best = linprog([0, 0, -1], rows, -planes[:, 2], bounds=[(None, None)] * 2 + [(0, None)])
    if not best.success or best.x[2] < 1e-7:
        return 0.0
    return float(ConvexHull(HalfspaceIntersection(planes, best.x[:2]).intersections).volume)


def clipped_area(p: np.ndarray, q: np.ndarray) -> float:
    vertices, count = clip(p[None], q[None])
    triangles, *_ = simplices(vertices, count)
    assert (measure(triangles) > -1e-15).all()
    return float(measure(triangles).sum())


polygon = st.sampled_from([3, 4]).flatmap(convex)


@given(polygon, polygon)
def test_clipping_finds_the_area_of_the_intersection(p: np.ndarray, q: np.ndarray) -> None:
    area = clipped_area(p, q)
    assert area == pytest.approx(intersection_area(p, q), abs=1e-6)
    assert area == pytest.approx(clipped_area(q, p), abs=1e-13)
    assert area <= min(measure(p[None])[0], measure(q[None])[0]) + 1e-13
    assert area == pytest.approx(clipped_area(np.roll(p, 1, axis=0), q), abs=1e-13)


@given(polygon, polygon)
def test_vertices_of_the_intersection_lie_in_both(p: np.ndarray, q: np.ndarray) -> None:
    vertices, count = clip(p[None], q[None])
    assume(count[0] > 0)
    homogeneous = np.column_stack([vertices[0], np.ones(len(vertices[0]))])
    assert (homogeneous @ np.vstack([half_planes(p), half_planes(q)]).T).max() < 1e-10
    np.testing.assert_array_equal(
        vertices[0, count[0] :], np.tile(vertices[0, 0], (len(vertices[0]) - count[0], 1))
    )


def test_many_pairs_are_clipped_as_each_alone() -> None:
    rng = np.random.default_rng(3)
    shift = rng.uniform(-1.2, 1.2, (200, 1, 2))
    square = np.array([[0.0, 0], [1, 0], [1, 1], [0, 1]])
    turned = square @ np.array([[0.8, 0.6], [-0.6, 0.8]])
    subject, window = turned + shift, np.tile(square, (200, 1, 1))
    vertices, count = clip(subject, window)
    triangles, pair, _ = simplices(vertices, count)
    together = np.bincount(pair, weights=measure(triangles), minlength=200)
    alone = [clipped_area(p, q) for p, q in zip(subject, window, strict=True)]
    np.testing.assert_allclose(together, alone, atol=1e-15)
    assert (count == 0).any()
    assert (count >= 6).any(), "too simple intersections"


def test_intervals_are_clipped_too() -> None:
    subject = np.array([[0.0, 1], [0.0, 1], [0.0, 1], [2.0, 5]])[:, :, None]
    window = np.array([[0.5, 2], [-1, 3], [1, 2], [3, 4]])[:, :, None]
    pieces, pair, _ = simplices(*clip(subject, window))
    np.testing.assert_array_equal(pair, [0, 1, 3])
    np.testing.assert_array_equal(pieces[:, :, 0], [[0.5, 1], [0, 1], [3, 4]])


@given(convex(4), st.floats(-1, 1), st.floats(-1, 1), st.booleans())
def test_local_coordinates_of_quadrilaterals_invert_the_bilinear_map(
    p: np.ndarray, s: float, t: float, backwards: bool
) -> None:
    p = p[::-1] if backwards else p
    local = np.array([[[s, t]]])
    there = facet_shape_values(local, 4) @ p[None]
    again = facet_shape_values(local_coordinates(there, p[None]), 4) @ p[None]
    np.testing.assert_allclose(again, there, atol=1e-13)
    np.testing.assert_allclose(local_coordinates(there, p[None]), local, atol=1e-9)


@pytest.mark.parametrize("corners", [2, 3])
def test_local_coordinates_of_simplices_invert_the_linear_map(corners: int) -> None:
    rng = np.random.default_rng(5)
    flat, local = rng.uniform(-1, 1, (50, corners, corners - 1)), rng.uniform(0, 0.5, (50, 4, corners - 1))
    np.testing.assert_allclose(
        local_coordinates(facet_shape_values(local, corners) @ flat, flat), local, atol=1e-10
    )


def test_the_rules_integrate_polynomials_of_degree_five() -> None:
    barycentric, weights = rule(2)
    x = barycentric[:, 1]
    np.testing.assert_allclose([weights @ x**k for k in range(6)], 1 / np.arange(1, 7), rtol=1e-14)
    barycentric, weights = rule(3)
    x, y = barycentric[:, 1], barycentric[:, 2]
    factorial = np.cumprod([1, *range(1, 8)])
    powers = [(i, j) for i in range(6) for j in range(6 - i)]
    exact = [2 * factorial[i] * factorial[j] / factorial[i + j + 2] for i, j in powers]
    np.testing.assert_allclose([weights @ (x**i * y**j) for i, j in powers], exact, rtol=1e-13)


@pytest.mark.parametrize("count", [0, 3])
def test_nothing_is_left_of_no_pairs_and_of_pairs_apart(count: int) -> None:
    square = np.tile(np.array([[0.0, 0], [1, 0], [1, 1], [0, 1]]), (count, 1, 1))
    vertices, left = clip(square + 2, square)
    np.testing.assert_array_equal(left, np.zeros(count))
    triangles, pair, _ = simplices(vertices, left)
    assert triangles.shape == (0, 3, 2)
    assert len(pair) == 0
