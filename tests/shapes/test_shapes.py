"""Shapes of surfaces: distances, normals and curvatures that belong together, wherever the shapes lie."""

from __future__ import annotations

import pickle
from collections.abc import Callable
from typing import Any

import numpy as np
import pytest
from scipy.spatial import cKDTree

from fenics_contact.shapes import (
    Box,
    Cone,
    Cylinder,
    Extruded,
    Parametric,
    Plane,
    Profile,
    Revolved,
    SignedDistance,
    Sphere,
    SurfaceShape,
    Torus,
)
from fenics_contact.shapes.combined import Joined, Placed, placed, simplified
from fenics_contact.shapes.parametric import tensor_grid
from fenics_contact.shapes.simple import closest_points, evaluate_shape
from tests.shapes.curvatures import principal_curvatures

AXIS = (1.0, 2.0, -1.0)
CENTRE = (0.1, -0.2, 0.3)
TURN = np.linalg.qr(np.random.default_rng(3).normal(size=(3, 3)))[0]


def ellipse(count: int = 40, *, reverse: bool = False) -> list[tuple[float, float]]:
    angle = np.linspace(0.0, 2 * np.pi, count, endpoint=False)[:: -1 if reverse else 1]
    return list(zip(2.0 * np.cos(angle), 1.5 * np.sin(angle), strict=True))


def circle(u: np.ndarray) -> np.ndarray:
    return 1.2 * np.column_stack([np.cos(u[:, 0]), np.sin(u[:, 0])])


def ring(u: np.ndarray) -> np.ndarray:
    arm = 1.5 + 0.4 * np.cos(u[:, 1])
    return np.column_stack([arm * np.cos(u[:, 0]), arm * np.sin(u[:, 0]), 0.4 * np.sin(u[:, 1])])


def ring_slopes(u: np.ndarray) -> np.ndarray:
    (c, k), (s, z) = np.cos(u).T, np.sin(u).T
    arm, none = 1.5 + 0.4 * k, np.zeros(len(u))
    around = np.column_stack([-arm * s, arm * c, none])
    return np.stack([around, 0.4 * np.column_stack([-z * c, -z * s, k])], axis=2)


TURNS = {"lower": (0.0, 0.0), "upper": (2 * np.pi, 2 * np.pi), "periodic": (True, True)}
SHAPES: dict[str, SurfaceShape] = {
    "half plane": Plane((0.2, -0.1), (1.0, 3.0)),
    "half space": Plane(CENTRE, (1.0, -2.0, 3.0)),
    "disc": Sphere((0.1, -0.2), 0.7),
    "ball": Sphere(CENTRE, 0.7),
    "socket": Sphere(CENTRE, 5.0, hollow=True),
    "bar": Cylinder(CENTRE, AXIS, 0.4),
    "torus": Torus(CENTRE, AXIS, 1.5, 0.4),
    "groove": Torus(CENTRE, AXIS, 1.5, 0.4, hollow=True),
    "prism": Extruded(Sphere((0.3, 0.1), 0.7), CENTRE, AXIS, (1.0, 0.0, 0.0)),
    "cone": Revolved(Plane((1.5, 0.0), (2.0, 1.0)), CENTRE, AXIS),
    "round cone": Cone(CENTRE, AXIS, 0.7, 0.3),
    "sharp cone": Cone(CENTRE, AXIS, 0.7),
    "box": Box(CENTRE, (1.0, 1.4, 1.2), 0.3, (0.3, -0.5, 0.2)),
    "rectangle": Box((0.1, -0.2), (1.0, 1.4), 0.3, 0.4),
    "spindle": Revolved(Sphere((0.0, 0.2), 0.6), CENTRE, AXIS),
    "ball turned": placed(Torus(CENTRE, AXIS, 1.5, 0.4), TURN, (0.3, 0.1, -0.2), 1.3),
    "circle": Parametric(circle, (0.0,), (2 * np.pi,), periodic=(True,)),
    "oval": Profile(ellipse(), closed=True),
    "oval prism": Extruded(Profile(ellipse(), closed=True), CENTRE, AXIS, (1.0, 0.0, 0.0)),
    "ring": Parametric(ring, **TURNS),  # type: ignore[arg-type]
    "ring with derivative": Parametric(ring, derivative=ring_slopes, **TURNS),  # type: ignore[arg-type]
}
ANALYTIC = [name for name in SHAPES if "oval" not in name and "ring" not in name and name != "circle"]


def points(dim: int, count: int = 200) -> np.ndarray:
    return np.random.default_rng(2).uniform(-2.0, 2.0, (count, dim))


def near(name: str) -> np.ndarray:
    """Points around a surface, away from where the closest one is not unique."""
    shape = SHAPES[name]
    x = points(shape.dim, 800)  # type: ignore[attr-defined]
    if name in {"half plane", "half space", "socket"}:
        return x
    x = x[np.abs(shape.distance(x)) < 0.35]
    assert len(x) > 20
    return x


def differences(function: Callable[[np.ndarray], np.ndarray], x: np.ndarray) -> np.ndarray:
    shifts = 1e-5 * np.eye(x.shape[1])
    return np.stack([(function(x + shift) - function(x - shift)) / 2e-5 for shift in shifts], axis=-1)


@pytest.mark.parametrize("name", SHAPES)
def test_normals_are_the_gradient_of_the_distance(name: str) -> None:
    shape, x = SHAPES[name], near(name)
    normals = shape.normals(x)
    np.testing.assert_allclose(normals, differences(shape.distance, x), atol=1e-8)
    np.testing.assert_allclose(np.linalg.norm(normals, axis=1), 1.0, rtol=1e-14)


@pytest.mark.parametrize("name", SHAPES)
def test_curvatures_are_the_derivative_of_the_normals(name: str) -> None:
    shape, x = SHAPES[name], near(name)
    # A spline's curvature bends at its points; second differences round.
    tolerance = 1e-3 if "oval" in name else 3e-5 if name in {"circle", "ring"} else 1e-6
    np.testing.assert_allclose(shape.curvatures(x), differences(shape.normals, x), atol=tolerance)


@pytest.mark.parametrize("name", SHAPES)
def test_closest_points_lie_on_the_surface_straight_below(name: str) -> None:
    shape, x = SHAPES[name], near(name)
    closest = closest_points(shape, x)
    np.testing.assert_allclose(shape.distance(closest), 0.0, atol=1e-14)
    np.testing.assert_allclose(np.linalg.norm(x - closest, axis=1), np.abs(shape.distance(x)), atol=1e-13)


@pytest.mark.parametrize("name", SHAPES)
def test_a_shape_far_from_the_origin_is_the_same(name: str) -> None:
    """A millionth of a millionth of the coordinates is what rounding leaves of distances."""
    shape, x = SHAPES[name], near(name)
    away = 1e6 * np.array([1.0, -0.7, 0.4])[: x.shape[1]]
    far = placed(shape, None, tuple(away))
    np.testing.assert_allclose(far.distance(x + away), shape.distance(x), atol=2e-9)
    np.testing.assert_allclose(far.normals(x + away), shape.normals(x), atol=1e-8)
    np.testing.assert_allclose(far.curvatures(x + away), shape.curvatures(x), atol=2e-6)


def test_a_parametrisation_far_from_the_origin_keeps_most_digits() -> None:
    away = 1e6 * np.array([1.0, -0.7])
    far = Parametric(lambda u: circle(u) + away, (0.0,), (2 * np.pi,), periodic=(True,))
    x = points(2)
    x = x[np.linalg.norm(x, axis=1) > 0.5]
    near_by = Sphere((0.0, 0.0), 1.2)
    np.testing.assert_allclose(far.distance(x + away), near_by.distance(x), atol=1e-8)
    np.testing.assert_allclose(far.normals(x + away), near_by.normals(x), atol=1e-6)
    np.testing.assert_allclose(far.curvatures(x + away), near_by.curvatures(x), atol=1e-3)


@pytest.mark.parametrize("name", ANALYTIC)
def test_points_move_with_the_shape(name: str) -> None:
    shape, x = SHAPES[name], near(name)
    dim = x.shape[1]
    turn = TURN if dim == 3 else np.array([[0.6, -0.8], [0.8, 0.6]])
    move, scale = np.arange(1.0, dim + 1), 0.8
    moved, there = placed(shape, turn, tuple(move), scale), scale * x @ turn.T + move
    np.testing.assert_allclose(moved.distance(there), scale * shape.distance(x), atol=1e-14)
    np.testing.assert_allclose(moved.normals(there), shape.normals(x) @ turn.T, atol=1e-13)
    np.testing.assert_allclose(
        moved.curvatures(there), turn @ shape.curvatures(x) @ turn.T / scale, rtol=1e-10, atol=1e-12
    )


@pytest.mark.parametrize("name", ANALYTIC)
def test_planes_balls_and_bars_that_are_moved_are_such_again(name: str) -> None:
    shape, x = SHAPES[name], near(name)
    dim = x.shape[1]
    turn = TURN if dim == 3 else np.array([[0.6, -0.8], [0.8, 0.6]])
    moved = placed(shape, turn, tuple(np.arange(1.0, dim + 1)), 0.8)
    again = simplified(moved)
    assert isinstance(again, Placed) != isinstance(shape, Plane | Sphere | Cylinder)
    np.testing.assert_allclose(again.distance(x), moved.distance(x), atol=1e-12)


def test_two_motions_are_one() -> None:
    ball, x = Torus(CENTRE, AXIS, 1.5, 0.4), points(3)
    other = TURN @ TURN.T[::-1]
    once = placed(ball, TURN, (1.0, 2.0, 3.0), 2.0)
    twice = placed(once, other, (-1.0, 0.5, 0.2), 0.3)
    assert isinstance(twice, Placed)
    assert twice.shape == ball
    unmerged = Placed(once, tuple(map(tuple, other)), (-1.0, 0.5, 0.2), 0.3)
    np.testing.assert_allclose(twice.distance(x), unmerged.distance(x), atol=1e-14)
    np.testing.assert_allclose(twice.normals(x), unmerged.normals(x), atol=1e-13)


@pytest.mark.parametrize(
    ("shape", "where", "curvatures"),
    [
        (Sphere((0, 0), 0.5), (0.5, 0), [2.0]),
        (Sphere((0, 0, 0), 0.5), (0, -0.5, 0), [2.0, 2.0]),
        (Sphere((0, 0, 0), 0.5, hollow=True), (0, 0, 0.5), [-2.0, -2.0]),
        (Cylinder((0, 0, 7), (0, 0, 1), 0.5), (0.3, 0.4, 0), [0.0, 2.0]),
        (Torus((0, 0, 0), (0, 0, 1), 2.0, 0.5), (2.5, 0, 0), [0.4, 2.0]),
        (Torus((0, 0, 0), (0, 0, 1), 2.0, 0.5), (0, 1.5, 0), [-1 / 1.5, 2.0]),
        (Torus((0, 0, 0), (0, 0, 1), 2.0, 0.5), (2.0, 0, 0.5), [0.0, 2.0]),
        (Plane((0, 0, 0), (1, 1, 1)), (0, 0, 0), [0.0, 0.0]),
        (Revolved(Sphere((0, 0), 0.5), (0, 0, 0), (0, 0, 1)), (0, 0, 0.5), [2.0, 2.0]),
        (Revolved(Sphere((0, 0), 0.5), (0, 0, 0), (0, 0, 1)), (1e-12, 0, -0.5), [2.0, 2.0]),
    ],
)
def test_principal_curvatures_are_those_of_textbooks(
    shape: SurfaceShape, where: tuple[float, ...], curvatures: list[float]
) -> None:
    found = principal_curvatures(shape, np.array([where]))
    np.testing.assert_allclose(found, [curvatures], atol=1e-12)


def test_an_ellipse_through_points_is_one() -> None:
    """The curvature of an ellipse of half axes a and b is a/b² and b/a² at its vertices."""
    oval = Profile(ellipse(400), closed=True)
    ends = np.array([[2.0, 0.0], [0.0, 1.5], [-2.0, 0.0], [0.0, -1.5]])
    np.testing.assert_allclose(oval.distance(ends), 0.0, atol=1e-14)
    bend = principal_curvatures(oval, ends)[:, 0]
    np.testing.assert_allclose(bend, [2 / 2.25, 1.5 / 4, 2 / 2.25, 1.5 / 4], rtol=1e-3)
    angle = np.linspace(0, 7, 50)
    between = np.column_stack([2.0 * np.cos(angle), 1.5 * np.sin(angle)])
    np.testing.assert_allclose(oval.distance(between), 0.0, atol=1e-8)
    assert oval.distance(np.zeros((1, 2))) == pytest.approx(-1.5)


def test_an_open_profile_goes_on_straight() -> None:
    arch = Profile([(2.0, 0.0), (0.0, 1.0), (-2.0, 0.0)])
    tangent = arch.normals(np.array([[2.0, 0.0]]))[0] @ np.array([[0.0, -1.0], [1.0, 0.0]])
    beyond = np.array([2.0, 0.0]) - np.outer([0.5, 1.0, 4.0], tangent * np.sign(tangent[0]) * -1)
    assert (beyond[:, 0] > 2.0).all()
    np.testing.assert_allclose(arch.distance(beyond), 0.0, atol=1e-12)
    np.testing.assert_allclose(arch.curvatures(beyond), 0.0, atol=1e-12)
    assert np.abs(arch.curvatures(np.array([[2.0, 0.0]]))).max() > 0.05


def test_curvatures_at_a_centre_of_curvature_are_large_and_finite() -> None:
    parabola = Profile([(1.0, 1.0), (0.0, 0.0), (-1.0, 1.0)])
    x = np.array([[0.0, 0.0], [0.0, 0.5], [0.0, 0.5 - 1e-15]])
    bend = np.abs(principal_curvatures(parabola, x)[:, 0])
    assert bend[0] == pytest.approx(2.0)
    assert ((bend[1:] > 1e5) & (bend[1:] < 1e7)).all()


def test_the_border_of_a_parametrisation_is_not_crossed_by_differences() -> None:
    """√u, which is known on one side of its border alone, bends there as a parabola does."""

    def root(u: np.ndarray) -> np.ndarray:
        return np.column_stack([np.sqrt(np.where(u < 0.25, np.nan, u)) - 3, -u])

    half = Parametric(root, (0.25,), (4.0,))
    with np.errstate(invalid="raise"):
        ends = np.array([[0.5 - 3, -0.25], [2.0 - 3, -4.0]])
        np.testing.assert_allclose(half.distance(ends), 0.0, atol=1e-13)
        normals = np.column_stack([-2 * np.sqrt([0.25, 4.0]), -np.ones(2)])
        normals /= np.linalg.norm(normals, axis=1)[:, None]
        np.testing.assert_allclose(half.normals(ends), normals, atol=1e-8)
        bend = np.array([2 / (1 + 4 * 0.25) ** 1.5, 2 / (1 + 4 * 4.0) ** 1.5])
        np.testing.assert_allclose(principal_curvatures(half, ends)[:, 0], -bend, rtol=1e-3)


def test_a_closest_point_is_found_from_few_samples() -> None:
    """Newton's full steps lead away on a curve that turns between its samples."""
    wave = Parametric(lambda u: np.column_stack([-u[:, 0], np.sin(3 * u[:, 0])]), (-3.0,), (3.0,), samples=12)
    dense = np.linspace(-3.0, 3.0, 60001)
    line = np.column_stack([-dense, np.sin(3 * dense)])
    x = np.random.default_rng(8).uniform(-1.5, 1.5, (300, 2))
    exact = cKDTree(line).query(x)[0]
    found = np.abs(wave.distance(x))
    # A valley beside the nearest one may be found from so few samples, but always the floor of one.
    assert (np.abs(found - exact) < 1e-6).mean() > 0.9
    feet = x - wave.distance(x)[:, None] * wave.normals(x)
    np.testing.assert_allclose(feet[:, 1], np.sin(-3 * feet[:, 0]), atol=1e-9)


def test_a_corner_in_the_plane_has_two_sides() -> None:
    """A quarter plane: above y = 0 and to the right of x = 0 is outside of both its sides, or of one."""
    sides = (Plane((0.0, 0.0), (0.0, 1.0)), Plane((0.0, 0.0), (1.0, 0.0)))
    steps = np.linspace(0.0, 1.0, 5)
    floor = np.stack(
        [np.column_stack([-steps[:-1], 0 * steps[1:]]), np.column_stack([-steps[1:], 0 * steps[1:]])], 1
    )
    corner = Joined(sides, (floor, floor[:, :, ::-1]))
    x = np.array([[-0.5, 0.2], [0.3, -0.4], [-0.3, -0.1], [-0.1, -0.3], [0.2, 0.1], [0.1, 0.2]])
    np.testing.assert_allclose(corner.distance(x), [0.2, 0.3, -0.1, -0.1, 0.2, 0.2], atol=1e-14)
    np.testing.assert_allclose(corner.normals(x[:4]), [[0, 1], [1, 0], [0, 1], [1, 0]], atol=1e-14)
    assert corner.curvatures(x).shape == (6, 2, 2)


def test_the_body_is_on_the_side_that_the_direction_tells() -> None:
    x = np.array([[0.1, 0.2]])
    assert Profile(ellipse(), closed=True).distance(x) < 0
    assert Profile(ellipse(reverse=True), closed=True).distance(x) > 0
    assert Profile(ellipse(reverse=True), closed=True, flipped=True).distance(x) < 0
    flipped = Parametric(ring, flipped=True, **TURNS)  # type: ignore[arg-type]
    np.testing.assert_array_equal(flipped.distance(points(3)), -SHAPES["ring"].distance(points(3)))


def test_a_parametrised_torus_is_the_torus() -> None:
    torus, x = Torus((0, 0, 0), (0, 0, 1), 1.5, 0.4), near("ring")
    for name in ("ring", "ring with derivative"):
        np.testing.assert_allclose(SHAPES[name].distance(x), torus.distance(x), atol=1e-13)
        np.testing.assert_allclose(SHAPES[name].normals(x), torus.normals(x), atol=1e-9)
        np.testing.assert_allclose(SHAPES[name].curvatures(x), torus.curvatures(x), atol=2e-6)


def test_the_profile_of_a_prism_lies_across_and_to_the_right_hand() -> None:
    x = np.array([[0.3, 5.0, 0.8]])
    prism = Extruded(SignedDistance(lambda p: p[:, 0]), (0, 0, 0), (0, 0, 2), (0, 3, 1))
    np.testing.assert_allclose(prism.distance(x), [5.0])
    upright = Extruded(SignedDistance(lambda p: p[:, 1]), (0, 0, 0), (0, 0, 2), (0, 3, 1))
    np.testing.assert_allclose(upright.distance(x), [-0.3])


@pytest.mark.parametrize(
    ("shape", "where"),
    [
        (Sphere(CENTRE, 0.7), CENTRE),
        (Sphere(CENTRE[:2], 0.7, hollow=True), CENTRE[:2]),
        (Cylinder(CENTRE, AXIS, 0.4), CENTRE),
        (Torus(CENTRE, AXIS, 1.5, 0.4), CENTRE),
        (Torus((0, 0, 0), (0, 0, 1), 1.5, 0.4), (1.5, 0.0, 0.0)),
        (Torus((0, 0, 0), (0, 0, 1), 1.5, 0.4), (0.0, 0.0, 3.0)),
        (Revolved(Plane((0.5, 0.0), (2.0, 1.0)), CENTRE, AXIS), CENTRE),
        (Profile(ellipse(), closed=True), (0.0, 0.0)),
        (SHAPES["circle"], (0.0, 0.0)),
        (SHAPES["ring"], (0.0, 0.0, 0.0)),
        (SHAPES["ring"], (1.5, 0.0, 0.0)),
    ],
)
def test_where_the_closest_point_is_not_unique_one_of_them_is_taken(
    shape: SurfaceShape, where: tuple[float, ...]
) -> None:
    x = np.array([where])
    normals = evaluate_shape(shape, "normals", x)
    np.testing.assert_allclose(np.linalg.norm(normals), 1.0)
    np.testing.assert_allclose(shape.distance(closest_points(shape, x)), 0.0, atol=1e-12)
    assert np.isfinite(evaluate_shape(shape, "curvatures", x)).all()
    assert np.isfinite(principal_curvatures(shape, x)).all()


@pytest.mark.parametrize("name", SHAPES)
def test_no_points_are_no_distances(name: str) -> None:
    shape = SHAPES[name]
    dim: int = shape.dim  # type: ignore[attr-defined]
    nothing = np.zeros((0, dim))
    assert shape.distance(nothing).shape == (0,)
    assert shape.normals(nothing).shape == (0, dim)
    assert shape.curvatures(nothing).shape == (0, dim, dim)
    assert closest_points(shape, nothing).shape == (0, dim)
    assert principal_curvatures(shape, nothing).shape == (0, dim - 1)


def test_a_distance_that_is_nearly_one_is_walked_down_in_several_steps() -> None:
    shape = SignedDistance(lambda x: (np.linalg.norm(x, axis=1) - 1.0) * (1 + 0.03 * np.sin(x[:, 0])))
    x = points(2)
    x = x[np.abs(np.linalg.norm(x, axis=1) - 1.0) < 0.5]
    np.testing.assert_allclose(np.linalg.norm(closest_points(shape, x), axis=1), 1.0, atol=1e-13)


@pytest.mark.parametrize("name", SHAPES)
def test_shapes_can_be_sent_to_other_ranks(name: str) -> None:
    shape, x = SHAPES[name], near(name)[:5]
    before = shape.distance(x)
    np.testing.assert_array_equal(pickle.loads(pickle.dumps(shape)).distance(x), before)


def test_shapes_are_recognised_by_their_members() -> None:
    assert all(isinstance(shape, SurfaceShape) for shape in SHAPES.values())
    assert not isinstance(object(), SurfaceShape)


def test_a_tensor_grid_has_every_combination_and_its_last_coordinate_runs_fastest() -> None:
    grid = tensor_grid([[0, 1], [5, 6, 7]])
    np.testing.assert_array_equal(grid, [[0, 5], [0, 6], [0, 7], [1, 5], [1, 6], [1, 7]])
    assert np.issubdtype(grid.dtype, np.integer), "counts stay whole numbers"


@pytest.mark.parametrize(
    ("kind", "more"),
    [
        (Plane, [(0.0, 0.0, 1.0)]),
        (Sphere, [2.0]),
        (Cylinder, [(0.0, 1.0, 0.0), 2.0]),
        (Torus, [(0.0, 1.0, 0.0), 2.0, 0.5]),
        (Box, [(1.0, 2.0, 3.0)]),
    ],
)
def test_shapes_of_arrays_are_those_of_numbers(kind: Any, more: list[Any]) -> None:
    given = kind(np.zeros(3), *(np.array(each) if isinstance(each, tuple) else each for each in more))
    assert given == kind([0.0, 0.0, 0.0], *more) == kind((0, 0, 0), *more)
    assert hash(given) == hash(kind((0, 0, 0), *more))
