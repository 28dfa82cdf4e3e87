"""Shapes of surfaces that are none are refused, and answers that a shape must not give."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np
import pytest

from fenics_contact.errors import InvalidInputError, UserCodeError
from fenics_contact.shapes import (
    Box,
    Cone,
    Extruded,
    Parametric,
    Plane,
    Profile,
    Revolved,
    SignedDistance,
    Sphere,
    Torus,
)
from fenics_contact.shapes.combined import Joined, placed
from fenics_contact.shapes.simple import evaluate_shape

AXIS = (1.0, 2.0, -1.0)
CENTRE = (0.1, -0.2, 0.3)


def circle(u: np.ndarray) -> np.ndarray:
    return 1.2 * np.column_stack([np.cos(u[:, 0]), np.sin(u[:, 0])])


@pytest.mark.parametrize(
    ("build", "message"),
    [
        (
            lambda: Torus(CENTRE, AXIS, 1.0, 1.0),
            r"^ring_radius must exceed tube_radius, got 1.0",
        ),
        (lambda: Torus(CENTRE, AXIS, np.nan, 1.0), "ring_radius must exceed tube_radius, got nan"),
        (
            lambda: Torus(CENTRE, AXIS, 1.0, 0.0),
            "^Torus.tube_radius must be positive, got 0.0: for a hole",
        ),
        (
            lambda: Torus(CENTRE, (0.0, 0.0, 0.0), 2.0, 1.0),
            "^Torus.axis must be 3 finite numbers, not all zero",
        ),
        (lambda: Torus((0.0, 0.0), AXIS, 2.0, 1.0), "^Torus must be placed by 3 finite numbers"),
        (
            lambda: Cone(CENTRE, AXIS, 1.6),
            "^half_angle must be from 0 to π/2 in radians, got 1.6",
        ),
        (lambda: Cone(CENTRE, AXIS, 1.0, -0.1), "^Cone.radius must be at least 0, got -0.1"),
        (lambda: Box(CENTRE, (1.0, 2.0)), r"^Box.size must be 3 positive numbers, got \(1.0, 2.0\)"),
        (lambda: Box(CENTRE, (1.0, 2.0, 0.0)), "^Box.size must be 3 positive numbers"),
        (
            lambda: Box(CENTRE, (1.0, 2.0, 3.0), 0.6),
            "^Box.radius must be at most 0.5, half the size, got 0.6",
        ),
        (
            lambda: Box(CENTRE, (1.0, 2.0, 3.0), rotation=0.6),
            "^Box.rotation must be three finite numbers, in",
        ),
        (lambda: Box((0.0, 0.0), (1.0, 2.0), rotation=AXIS), "^Box.rotation must be one finite number"),
        (lambda: Sphere(CENTRE, -1.0), "^Sphere.radius must be positive, got -1.0"),
        (
            lambda: Extruded(Sphere((0.0, 0.0), 1.0), CENTRE, AXIS, AXIS),
            r"^Extruded.across must not be parallel to the axis .*, got \(1.0, 2.0, -1.0\): turn",
        ),
        (
            lambda: Extruded(Sphere(CENTRE, 1.0), CENTRE, AXIS, (1.0, 0.0, 0.0)),
            "^Extruded.profile must be a plane shape, got Sphere in space",
        ),
        (
            lambda: Revolved(Plane(CENTRE, AXIS), CENTRE, AXIS),
            "^Revolved.profile must be a plane shape",
        ),
        (lambda: Revolved("wire", CENTRE, AXIS), "^Revolved.profile must be a SurfaceShape with distance"),
        (
            lambda: placed(Sphere(CENTRE, 1.0), 2.0 * np.eye(3), (0.0, 0.0, 0.0)),
            r"^Placed.rotation must be an orthogonal matrix of shape \(3, 3\), got",
        ),
        (lambda: placed(Sphere(CENTRE, 1.0), np.eye(2), (0.0, 0.0, 0.0)), "^Placed.rotation must be an orth"),
        (
            lambda: placed(Sphere(CENTRE, 1.0), None, CENTRE, -1.0),
            "^Placed.scale must be positive, got -1.0: mirror",
        ),
        (
            lambda: placed(Sphere((0.0, 0.0), 1.0), None, CENTRE),
            "^Placed.translation must have 2 entries as its shape, got 3",
        ),
        (lambda: Profile([(0.0, 0.0), (1.0, 0.0)]), "^Profile.points must be three or more different points"),
        (
            lambda: Profile([(0.0, 0.0), (0.0, 0.0), (1.0, 0.0)]),
            r"must be .* different points in the plane, got \[\(0.0, 0.0\), \(0.0",
        ),
        (
            lambda: Profile([(0.0, 0.0), (1.0, 1.0), (0.0, 0.0)], closed=True),
            r"must be .* different points in the plane, got .* \(0.0, 0.0\)\]$",
        ),
        (
            lambda: Joined((Plane(CENTRE, AXIS),), ()),
            r"^Joined needs facets of each of 1 shapes, got \[\]",
        ),
        (lambda: Parametric(circle, (1.0,), (0.0,)), "^lower must be one or two numbers below upper"),
        (
            lambda: Parametric(circle, (0.0,), (1.0,), periodic=(True, True)),
            "^periodic needs 1 booleans, samples 3",
        ),
        (
            lambda: Parametric(lambda u: u, (0.0,), (1.0,)),
            r"^position must return finite numbers of",
        ),
    ],
)
def test_a_shape_that_is_none_is_refused(build: Callable[[], object], message: str) -> None:
    with pytest.raises(InvalidInputError, match=message):
        build()


def test_a_pole_of_a_parametrisation_is_refused_where_it_is_met() -> None:
    def ball(u: np.ndarray) -> np.ndarray:
        (a, b), (s, t) = np.cos(u).T, np.sin(u).T
        return np.column_stack([a * b, s * b, t])

    shape = Parametric(ball, (0.0, -np.pi / 2), (2 * np.pi, np.pi / 2), periodic=(True, False))
    np.testing.assert_allclose(shape.distance(np.array([[2.0, 0.0, 0.1]])), np.hypot(2.0, 0.1) - 1)
    message = r"derivatives must not be zero or parallel, got such at \[.*1. *\]"
    with pytest.raises(InvalidInputError, match=message):
        shape.normals(np.array([[0.0, 0.0, 2.0]]))


def test_an_answer_of_another_shape_is_refused_and_an_error_is_named() -> None:
    class Wrong(SignedDistance):
        def curvatures(self, points: np.ndarray) -> np.ndarray:
            return np.zeros(3)

    def fails(x: np.ndarray) -> np.ndarray:
        raise ZeroDivisionError

    message = r"^the curvatures of Wrong must be finite numbers of shape \(4, 2, 2\), got shape \(3,\)"
    with pytest.raises(InvalidInputError, match=message):
        evaluate_shape(Wrong(lambda x: x[:, 0]), "curvatures", np.ones((4, 2)))
    with pytest.raises(UserCodeError, match="the distance of SignedDistance"):
        evaluate_shape(SignedDistance(fails), "distance", np.ones((4, 2)))
