"""Views are right-handed, and frames hold what they should."""

from __future__ import annotations

import numpy as np
import pytest

from fenics_contact.pictures.canvas import axis_label, face_on, frame_around, oblique_view

RNG = np.random.default_rng(3)


def box(*size: float) -> np.ndarray:
    return RNG.uniform(size=(50, 3)) * size


@pytest.mark.parametrize("size", [(9.0, 2.0, 2.0), (2.0, 9.0, 2.0), (1.0, 2.0, 9.0)])
def test_view_is_a_right_handed_frame(size: tuple[float, float, float]) -> None:
    view = oblique_view(box(*size))
    frame = np.array([view.right, view.up, view.towards])
    np.testing.assert_allclose(frame @ frame.T, np.eye(3), atol=1e-14)
    assert np.linalg.det(frame) == pytest.approx(1.0)


def test_the_longest_horizontal_direction_is_horizontal_in_the_picture() -> None:
    for axis, size in enumerate([(9.0, 2.0, 2.0), (2.0, 9.0, 2.0)]):
        shown = oblique_view(box(*size)).project(np.eye(3))
        assert shown[axis, 0] > 0.5
        assert abs(shown[axis, 1]) < 1e-14
        assert shown[2, 1] > 0.5, "z points up"


def test_what_is_as_long_as_wide_is_seen_alike_whatever_its_rounding() -> None:
    square = np.array([[0.0, 0.0, 0.0], [4.0, 4.0, 3.0]])
    rounded = square + np.outer([0.0, 1e-7], [0.0, 1.0, 0.0])
    np.testing.assert_allclose(oblique_view(rounded).right, oblique_view(square).right, atol=1e-14)


def test_frame_holds_all_points_and_its_margin() -> None:
    points = box(4.0, 2.0, 3.0)
    view = oblique_view(points)
    places, frame = view.project(points), frame_around(view, points, 0.1)
    assert np.all(places > frame.low)
    assert np.all(places < frame.high)
    np.testing.assert_allclose(frame.size - np.ptp(places, axis=0), 0.2 * np.ptp(places, axis=0).max())


@pytest.mark.parametrize(
    ("normal", "right", "up"),
    [((1, 0, 0), "y", "z"), ((0, -2, 0), "x", "z"), ((0, 0, 1), "x", "y"), ((0, 0, -1), "−x", "y")],
)
def test_face_on_keeps_the_axes_upright(normal: tuple[float, ...], right: str, up: str) -> None:
    view = face_on(np.array(normal, dtype=float))
    assert (axis_label(view.right), axis_label(view.up)) == (right, up)


def test_a_slanted_direction_has_no_axis_name() -> None:
    assert axis_label(np.array([0.6, 0.8, 0.0])) == ""
