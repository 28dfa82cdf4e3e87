"""Fields known at some points, as functions of position."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest

from fenics_contact import SampledField
from fenics_contact.errors import InvalidInputError

RANDOM = np.random.default_rng(7)


def smooth(x: np.ndarray) -> np.ndarray:
    return np.sin(2.0 * x[:, 0]) + x[:, 1] ** 2


def on_a_cylinder(count: int) -> np.ndarray:
    angle, height = RANDOM.random((2, count)) * [[2.0 * np.pi], [2.0]]
    return np.column_stack([np.cos(angle), np.sin(angle), height])


def in_a_box(count: int) -> np.ndarray:
    return RANDOM.random((count, 3))


def on_a_plane(count: int) -> np.ndarray:
    return RANDOM.random((count, 3)) * (1.0, 1.0, 0.0)


PLACES = pytest.mark.parametrize("places", [on_a_cylinder, in_a_box, on_a_plane])


@PLACES
def test_the_given_values_are_kept(places: Any) -> None:
    points = places(300)
    field = SampledField(points, smooth(points))
    np.testing.assert_allclose(field(points), smooth(points), atol=1e-9)
    vector = SampledField(points, np.column_stack([smooth(points)] * 3) * (1.0, 2.0, 3.0))
    np.testing.assert_allclose(vector(points)[:, 1], 2.0 * smooth(points), atol=1e-9)


@PLACES
def test_more_points_make_a_field_more_accurate(places: Any) -> None:
    errors, asked = [], places(300)
    for count in (400, 6400):
        points = places(count)
        found = SampledField(points, smooth(points), 10.0)(asked)
        errors.append(np.sqrt(np.mean((found - smooth(asked)) ** 2)))
    # 16 times as many points: 4 times as dense on surfaces, 2.5 times in the box.
    assert errors[1] < 0.4 * errors[0]
    assert errors[1] < 0.02


def test_on_a_line_it_is_linear_between_neighbours() -> None:
    x = np.array([0.0, 1.0, 3.0, 4.0])
    field = SampledField(np.column_stack([x, 0 * x]), x**2)
    np.testing.assert_allclose(field(np.array([[0.5, 0.0], [2.0, 0.0]])), [0.5, 5.0])


def test_points_of_a_plane_suit_plane_bodies() -> None:
    points = np.array([[0.0, 0.0, 5.0], [1.0, 0.0, 5.0], [0.0, 1.0, 5.0]])
    assert SampledField(points, np.arange(3.0))(points[:, :2]).tolist() == pytest.approx([0, 1, 2])
    assert SampledField(points, points)(points[:, :2]).shape == (3, 2)


def test_one_point_is_the_same_everywhere_within_its_reach() -> None:
    assert SampledField([[0.0, 0.0]], [3.0])(np.array([[50.0, 1.0], [2.0, 2.0]])).tolist() == [3.0, 3.0]
    with pytest.raises(InvalidInputError, match="it reaches only 2"):
        SampledField([[0.0, 0.0]], [3.0], 2.0)(np.array([[5.0, 0.0]]))


def test_no_value_is_invented_far_from_the_points() -> None:
    points = np.array([[0.0, 0.0, 0.0], [1.0, 0.0, 0.0], [2.5, 0.0, 0.0]])
    field = SampledField(points, np.zeros(3))
    assert field(np.array([[5.4, 0.0, 0.0]])) == 0.0
    with pytest.raises(InvalidInputError, match=r"is 3\.5 from \(6, 0, 0\), and it reaches only 3"):
        field(np.array([[1.0, 0.0, 0.0], [6.0, 0.0, 0.0]]))
    assert SampledField(points, np.zeros(3), reach=4.0)(np.array([[6.0, 0.0, 0.0]])) == 0.0


@pytest.mark.parametrize(
    ("points", "values", "reach", "message"),
    [
        ([1.0, 2.0], [1.0, 2.0], None, "points must be rows of two or three finite numbers, got shape"),
        (np.zeros((0, 3)), [], None, "points must be rows"),
        ([[0, 0, np.nan]], [1.0], None, "points must be rows .* got something other than finite"),
        ([[0, 0, 0]], [1.0, 2.0], None, "values must be 1 finite numbers, or rows of 3"),
        ([[0, 0, 0], [1, 0, 0]], [[1.0, 2.0], [1.0, 2.0]], None, "values must be 2 finite numbers"),
        ([[0, 0, 0], [1, 0, 0], [0, 0, 0]], [1.0, 2.0, 3.0], None, "points 0 and 2 are the same"),
        ([[0, 0, 0]], [1.0], 0.0, "reach must be a length above zero"),
        ([[0, 0, 0]], [1.0], np.inf, "reach must be a length above zero"),
    ],
)
def test_what_is_no_field_is_refused(points: Any, values: Any, reach: Any, message: str) -> None:
    with pytest.raises(InvalidInputError, match=message):
        SampledField(points, values, reach)


def test_points_in_space_do_not_suit_plane_bodies() -> None:
    with pytest.raises(InvalidInputError, match="they have 3 coordinates and the bodies 2"):
        SampledField(np.eye(3), np.zeros(3))(np.zeros((1, 2)))
    with pytest.raises(InvalidInputError, match="they have 2 coordinates and the bodies 3"):
        SampledField(np.eye(2), np.zeros(2))(np.zeros((1, 3)))
