"""Diagrams of curves."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np
import pytest

from fenics_contact.errors import InvalidInputError
from fenics_contact.pictures import plot_curves
from tests.viz.states import contains, pixels

X = np.linspace(0.0, 1.0, 11)
NAMES = {"xlabel": "x (mm)", "ylabel": "p (MPa)"}


def test_series_and_reference_are_drawn_apart(tmp_path: Path) -> None:
    series = {"first": (X, X**2), "second": (X, X**3)}
    path = plot_curves(series, tmp_path / "curves.png", reference={"theory": (X, X)}, title="Known", **NAMES)
    image = pixels(path)
    assert image.shape == (720, 1200, 3)
    for colour in ("#0072b2", "#d55e00", "#222222"):
        assert contains(image, colour)
    alone = pixels(plot_curves({"first": (X, X**2)}, tmp_path / "one.png", **NAMES))
    assert not contains(alone, "#d55e00")


def test_points_may_be_connected_and_gaps_left(tmp_path: Path) -> None:
    broken = {"path": (X, np.where(X > 0.5, np.nan, X))}
    loose = pixels(plot_curves(broken, tmp_path / "loose.png", **NAMES))
    bound = pixels(plot_curves(broken, tmp_path / "bound.png", connected=True, **NAMES))
    blue = [np.sum(image[..., 2] - image[..., 0] > 0.5) for image in (loose, bound)]
    assert blue[1] > 1.3 * blue[0]


def test_many_points_become_a_line_and_axes_logarithmic(tmp_path: Path) -> None:
    x = np.geomspace(1.0, 100.0, 200)
    path = plot_curves({"error": (x, 1 / x)}, tmp_path / "log.png", logarithmic=True, width=600, **NAMES)
    assert contains(pixels(path), "#0072b2", 0.05)


@pytest.mark.parametrize(
    ("series", "message"),
    [
        ({}, r"a diagram needs at least one curve, got none"),
        ({"a": (X, X[:3])}, r"curve 'a' must have one value for each place, got \(3,\) for \(11,\)"),
        ({"a": ([], [])}, r"curve 'a' must have one value for each place, got \(0,\) for \(0,\)"),
    ],
)
def test_curves_that_cannot_be_drawn_are_refused(series: Any, message: str, tmp_path: Path) -> None:
    with pytest.raises(InvalidInputError, match=message):
        plot_curves(series, tmp_path / "curves.png", **NAMES)
    assert not list(tmp_path.iterdir())
