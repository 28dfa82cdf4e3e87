"""Sheets have the size asked for, and drawing leaves no trace in matplotlib's settings."""

from __future__ import annotations

from collections.abc import Callable
from io import BytesIO
from typing import Any

import matplotlib as mpl
import numpy as np
import pytest
from matplotlib.cm import ScalarMappable
from matplotlib.colors import Normalize

from fenics_contact.errors import InvalidInputError
from fenics_contact.pictures import Picture, Units
from fenics_contact.pictures.canvas import Frame, add_colour_bar, face_on, png_path, sheet, show_image
from fenics_contact.pictures.unrolled import label_axes
from tests.viz.states import pixels


def drawn(
    size: tuple[int, int], title: str, draw: Callable[[Any], object] = lambda figure: None
) -> np.ndarray:
    """Return the pixels of a sheet."""
    paper = BytesIO()
    with sheet(paper, size, title) as figure:
        draw(figure)
    return pixels(Picture(paper.getvalue()))


def test_a_sheet_has_the_size_asked_for_and_a_title() -> None:
    assert drawn((320, 200), "title").shape == (200, 320, 3)
    assert np.any(drawn((320, 200), "title") < 0.5), "the title is missing"
    assert not np.any(drawn((320, 200), "") < 0.5)


def test_an_image_keeps_its_proportions_and_its_coordinates() -> None:
    frame = Frame(np.array([1.0, 2.0]), np.array([4.0, 3.0]))
    image = np.full((20, 60, 3), 128, dtype=np.uint8)

    def draw(figure: Any) -> None:
        axes = figure.subplots()
        show_image(axes, image, frame, coordinates=True)
        assert (axes.get_xlim(), axes.get_ylim()) == ((1.0, 4.0), (2.0, 3.0))
        axes.set_axis_off()

    found = drawn((800, 600), "", draw)
    grey = np.all(np.abs(found - 128 / 255) < 0.02, axis=-1)
    width, height = (np.count_nonzero(np.any(grey, axis=axis)) for axis in (0, 1))
    assert width == pytest.approx(3 * height, rel=0.03)


@pytest.mark.parametrize(
    ("beyond", "ends"),
    [((0.0, 515.0), "max"), ((-2.0, 515.0), "both"), ((-2.0, 400.0), "min"), (None, "neither")],
)
def test_a_bar_is_pointed_where_values_lie_beyond_its_colours(
    beyond: tuple[float, float] | None, ends: str
) -> None:
    def draw(figure: Any) -> None:
        panel, key = figure.subplots(), ScalarMappable(Normalize(0, 400))
        add_colour_bar(figure, [panel], key, "σ", beyond=beyond)
        assert key.colorbar.extend == ends

    drawn((640, 400), "", draw)


def test_an_axis_that_runs_backwards_says_so() -> None:
    labels = []

    def draw(figure: Any) -> None:
        for view, mirror in (
            (face_on(np.array([0.0, 0.0, -1.0])), False),
            (face_on(np.array([0.0, 0.0, -1.0])), True),
            (face_on(np.array([1.0, 0.0, 0.0])), False),
        ):
            axes = figure.subplots()
            axes.set_xlim(0.0, 2.0)
            label_axes(axes, view, Units(), mirror=mirror)
            labels.append((axes.get_xlabel(), axes.get_ylabel(), axes.xaxis_inverted()))

    drawn((640, 400), "", draw)
    assert labels == [
        ("x (mm), runs to the left: seen from −z", "y (mm)", False),
        ("x (mm)", "y (mm)", True),
        ("y (mm)", "z (mm)", False),
    ]


def test_a_title_that_is_too_long_is_made_smaller() -> None:
    for words in ("short", "a title of very many words " * 6):
        ink = np.flatnonzero(np.any(drawn((640, 200), words) < 0.5, axis=(0, 2)))
        assert ink.size > 20
        assert 0.005 * 640 < ink.min()
        assert ink.max() < 0.995 * 640


def test_settings_of_the_user_neither_matter_nor_change() -> None:
    plain = drawn((320, 200), "title")
    with mpl.rc_context({"font.size": 40, "figure.facecolor": "black"}):
        before = dict(mpl.rcParams)
        odd = drawn((320, 200), "title")
        assert dict(mpl.rcParams) == before
    np.testing.assert_array_equal(plain, odd)


@pytest.mark.parametrize("name", ["picture.jpg", "picture"])
def test_only_png_files_are_written(name: str) -> None:
    with pytest.raises(InvalidInputError, match=r"pictures are PNG files, got the name .* end in '\.png'"):
        png_path(name)
