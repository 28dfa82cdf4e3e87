"""Rigid obstacles: distances, normals and curvatures that belong together, and what is refused."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np
import pytest

from fenics_contact import (
    Body,
    ContactPair,
    DistanceObstacle,
    RigidCylinder,
    RigidPlane,
    RigidSphere,
    Scene,
    Surface,
)
from fenics_contact._scene.obstacles import RigidObstacle
from fenics_contact.errors import InvalidInputError
from fenics_contact.gallery import rectangle
from fenics_contact.materials import PlaneStrain

OBSTACLES: dict[str, tuple[RigidObstacle, int]] = {
    "half plane": (RigidPlane((0.2, -0.1), (1.0, 3.0)), 2),
    "half space": (RigidPlane((0.2, -0.1, 0.3), (1.0, -2.0, 3.0)), 3),
    "disc": (RigidSphere((0.1, -0.2), 0.7), 2),
    "round hole": (RigidSphere((0.1, -0.2), 5.0, hollow=True), 2),
    "ball": (RigidSphere((0.1, -0.2, 0.3), 0.7), 3),
    "socket": (RigidSphere((0.1, -0.2, 0.3), 5.0, hollow=True), 3),
    "bar": (RigidCylinder((0.1, -0.2, 0.3), (1.0, 2.0, -1.0), 0.4), 3),
    "bore": (RigidCylinder((0.1, -0.2, 0.3), (1.0, 2.0, -1.0), 4.0, hollow=True), 3),
}


def points(dim: int) -> np.ndarray:
    """Points in and outside the obstacles, none on an axis or a centre."""
    return np.random.default_rng(2).uniform(-2.0, 2.0, (200, dim))


def differences(
    function: Callable[[np.ndarray], np.ndarray], x: np.ndarray, step: float = 1e-5
) -> np.ndarray:
    shifts = step * np.eye(x.shape[1])
    return np.stack([(function(x + shift) - function(x - shift)) / (2 * step) for shift in shifts], axis=-1)


@pytest.mark.parametrize("name", OBSTACLES)
def test_normals_are_the_gradient_of_the_distance(name: str) -> None:
    obstacle, dim = OBSTACLES[name]
    x = points(dim)
    normals = obstacle.normals(x)
    assert normals.shape == x.shape
    np.testing.assert_allclose(normals, differences(obstacle.distance, x), atol=1e-8)
    np.testing.assert_allclose(np.linalg.norm(normals, axis=1), 1.0, rtol=1e-14)


@pytest.mark.parametrize("name", OBSTACLES)
def test_curvatures_are_the_derivative_of_the_normals(name: str) -> None:
    obstacle, dim = OBSTACLES[name]
    x = points(dim)
    curvatures = obstacle.curvatures(x)
    assert curvatures.shape == (200, dim, dim)
    np.testing.assert_allclose(curvatures, differences(obstacle.normals, x), atol=1e-7)
    np.testing.assert_array_equal(curvatures.any(), "half" not in name)


@pytest.mark.parametrize("name", OBSTACLES)
def test_a_step_along_the_normal_changes_the_distance_by_its_length(name: str) -> None:
    obstacle, dim = OBSTACLES[name]
    x = points(dim)
    np.testing.assert_allclose(
        obstacle.distance(x + 0.01 * obstacle.normals(x)), obstacle.distance(x) + 0.01, rtol=1e-12, atol=1e-12
    )


@pytest.mark.parametrize(("full", "hollow"), [("disc", "round hole"), ("ball", "socket"), ("bar", "bore")])
def test_hollow_obstacles_are_inside_out(full: str, hollow: str) -> None:
    (inner, dim), (outer, _) = OBSTACLES[full], OBSTACLES[hollow]
    x = points(dim)
    both = inner.distance(x) + outer.distance(x)
    np.testing.assert_allclose(both, outer.radius - inner.radius, rtol=1e-14)  # type: ignore[attr-defined]
    np.testing.assert_allclose(inner.normals(x), -outer.normals(x), rtol=1e-14)
    np.testing.assert_allclose(inner.curvatures(x), -outer.curvatures(x), rtol=1e-14)
    assert (inner.distance(x) < 0).any()
    assert (inner.distance(x) > 0).any()


@pytest.mark.parametrize("with_gradient", [True, False])
@pytest.mark.parametrize("name", OBSTACLES)
def test_a_function_of_the_same_distance_is_the_same_obstacle(name: str, with_gradient: bool) -> None:
    obstacle, dim = OBSTACLES[name]
    gradient = obstacle.normals if with_gradient else None
    given, x = DistanceObstacle(obstacle.distance, gradient), points(dim)
    # Away from the kink in the middle of round obstacles, which differences of the gradient feel from afar.
    x = x[np.linalg.norm(x - np.array([0.1, -0.2, 0.3])[:dim], axis=1) > 0.7]
    assert len(x) > 80
    np.testing.assert_array_equal(given.distance(x), obstacle.distance(x))
    np.testing.assert_allclose(given.normals(x), obstacle.normals(x), atol=1e-8)
    close = np.abs(obstacle.curvatures(x)).max(axis=(1, 2)) < 3.0
    assert close.sum() > 80
    np.testing.assert_allclose(given.curvatures(x)[close], obstacle.curvatures(x)[close], atol=2e-5)


def test_a_gradient_that_is_given_is_used() -> None:
    asked: list[np.ndarray] = []

    def gradient(x: np.ndarray) -> np.ndarray:
        asked.append(x)
        return np.tile((0.0, 1.0), (len(x), 1))

    DistanceObstacle(lambda x: x[:, 1], gradient).normals(points(2))
    assert len(asked) == 1


@pytest.mark.parametrize("name", OBSTACLES)
def test_no_points_give_no_distances(name: str) -> None:
    obstacle, dim = OBSTACLES[name]
    for each in (obstacle, DistanceObstacle(obstacle.distance)):
        nothing = np.zeros((0, dim))
        assert each.distance(nothing).shape == (0,)
        assert each.normals(nothing).shape == (0, dim)
        assert each.curvatures(nothing).shape == (0, dim, dim)


def test_the_centre_of_a_ball_is_at_its_radius() -> None:
    ball = RigidSphere((1.0, 2.0, 3.0), 0.5)
    assert ball.distance(np.array([[1.0, 2.0, 3.0]])) == pytest.approx(-0.5)
    assert np.isfinite(ball.normals(np.array([[1.0, 2.0, 3.0]]))).all()


def test_obstacles_are_recognised_by_their_members() -> None:
    for obstacle, _ in OBSTACLES.values():
        assert isinstance(obstacle, RigidObstacle)
    assert isinstance(DistanceObstacle(lambda x: x[:, 0]), RigidObstacle)


@pytest.mark.parametrize(
    ("build", "message"),
    [
        (
            lambda: RigidPlane((0.0,), (1.0,)),
            r"^RigidPlane must be placed by 2 or 3 finite numbers, got \(0.0,\)",
        ),
        (lambda: RigidPlane((0.0, np.nan), (0.0, 1.0)), "RigidPlane must be placed by 2 or 3 finite numbers"),
        (
            lambda: RigidPlane((0.0, 0.0, 0.0), (0.0, 0.0, 0.0)),
            r"^RigidPlane.normal must be 3 finite numbers, not all zero, got \(0.0, 0.0, 0.0\)",
        ),
        (lambda: RigidPlane((0.0, 0.0), (0.0, 0.0, 1.0)), "RigidPlane.normal must be 2 finite numbers"),
        (lambda: RigidSphere((0.0, np.inf), 1.0), "RigidSphere must be placed by 2 or 3 finite numbers"),
        (
            lambda: RigidSphere((0.0, 0.0), -1.0),
            r"^RigidSphere.radius must be positive, got -1.0: for a hole add hollow=True$",
        ),
        (lambda: RigidSphere((0.0, 0.0), np.nan), "RigidSphere.radius must be positive, got nan"),
        (
            lambda: RigidCylinder((0.0, 0.0), (0.0, 0.0, 1.0), 1.0),
            r"^RigidCylinder must be placed by 3 finite numbers, got \(0.0, 0.0\)",
        ),
        (
            lambda: RigidCylinder((0.0, 0.0, 0.0), (0.0, 1.0), 1.0),
            r"^RigidCylinder.axis must be 3 finite numbers, not all zero, got \(0.0, 1.0\)",
        ),
        (
            lambda: RigidCylinder((0.0, 0.0, 0.0), (0.0, 0.0, 1.0), 0.0),
            "RigidCylinder.radius must be positive, got 0.0",
        ),
    ],
)
def test_an_obstacle_that_is_none_is_refused(build: Callable[[], object], message: str) -> None:
    with pytest.raises(InvalidInputError, match=message):
        build()


@pytest.mark.parametrize(
    ("function", "given"),
    [
        (lambda x: x, r"got shape \(200, 2\)"),
        (lambda x: 0.0, r"got shape \(\)"),
        (lambda x: x[:, 0] / 0.0, "or NaN"),
    ],
)
def test_a_distance_that_is_no_number_a_point_is_refused(
    function: Callable[[np.ndarray], np.ndarray], given: str
) -> None:
    message = (
        r"the distance of DistanceObstacle must be one finite number per point, shape \(200,\), .*: write it "
        r"for an array of points"
    )
    with np.errstate(all="ignore"):
        with pytest.raises(InvalidInputError, match=message) as error:
            DistanceObstacle(function).distance(points(2))
        assert error.match(given)


@pytest.mark.parametrize("gradient", [None, lambda x: 2.0 * x])
def test_a_level_set_function_that_is_no_distance_is_refused(
    gradient: Callable[[np.ndarray], np.ndarray] | None,
) -> None:
    level_set = DistanceObstacle(lambda x: np.einsum("nd,nd->n", x, x) - 1.0, gradient)
    message = (
        r"DistanceObstacle needs the signed distance, with a gradient of length one, got 3 at "
        r"\[1.5 0. \]: divide by that, or round edges"
    )
    with pytest.raises(InvalidInputError, match=message):
        level_set.normals(np.array([[1.0, 0.0], [1.5, 0.0]])[1:])


@pytest.mark.parametrize(
    ("obstacle", "given"),
    [
        (RigidPlane((0.0, 0.0, 0.0), (0.0, 0.0, 1.0)), "RigidPlane in 3"),
        (RigidSphere((0.0, -1.0, 0.0), 1.0), "RigidSphere in 3"),
        (RigidCylinder((0.0, -1.0, 0.0), (0.0, 0.0, 1.0), 1.0), "RigidCylinder in 3"),
    ],
)
def test_an_obstacle_in_space_is_refused_below_a_plane_body(obstacle: RigidObstacle, given: str) -> None:
    body = Body(rectangle((0.0, 0.0), (1.0, 1.0), (1, 1)), PlaneStrain(1.0, 0.3))
    message = (
        f"an obstacle must lie in the space of the bodies, got a {given} dimensions: give it 2 "
        "coordinates; in the plane a RigidSphere is a round bar"
    )
    with pytest.raises(InvalidInputError, match=message):
        Scene({"block": body}, contacts=[ContactPair(Surface("block", "y0"), obstacle)])


@pytest.mark.parametrize("shift", [0.0, 1e3, 1e5, 1e7])
@pytest.mark.parametrize("size", [1e-9, 1.0, 1e9])
def test_differences_of_a_distance_are_right_far_from_the_origin(size: float, shift: float) -> None:
    """A ball of radius 3 seen by nodes within 2 of each other, wherever all of it lies."""
    centre = size * shift * np.array([1.0, -0.4, 0.7])
    ball = RigidSphere(tuple(centre), 3.0 * size)
    given = DistanceObstacle(ball.distance)
    points = centre + size * np.random.default_rng(5).uniform(2.0, 4.0, (20, 3))
    np.testing.assert_allclose(given.normals(points), ball.normals(points), atol=1e-8 + 3e-13 * shift)
    np.testing.assert_allclose(
        size * given.curvatures(points), size * ball.curvatures(points), atol=1e-4 + 1e-9 * shift
    )
