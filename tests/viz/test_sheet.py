"""Pictures appear whole or not at all, and drawing leaves no trace in matplotlib's settings."""

from __future__ import annotations

from pathlib import Path

import matplotlib as mpl
import numpy as np
import pytest

from fenics_contact.errors import InvalidInputError
from fenics_contact.viz.picture import png_path
from fenics_contact.viz.sheet import place_image, sheet
from tests.viz.states import pixels


def test_a_picture_has_the_size_asked_for_in_a_new_folder(tmp_path: Path) -> None:
    path = tmp_path / "new" / "picture.png"
    with sheet(path, (320, 200), "title"):
        pass
    assert pixels(path).shape == (200, 320, 3)
    assert np.any(pixels(path) < 0.5), "the title is missing"


def test_a_failing_drawing_leaves_the_old_picture_and_no_litter(tmp_path: Path) -> None:
    path = tmp_path / "picture.png"
    path.write_bytes(b"old")

    with pytest.raises(ZeroDivisionError), sheet(path, (320, 200), "title") as figure:
        figure.savefig = lambda file, **_: file.write(b"half") and 1 / 0
    assert path.read_bytes() == b"old"
    assert list(tmp_path.iterdir()) == [path]


def test_an_image_is_placed_pixel_on_pixel(tmp_path: Path) -> None:
    image = np.random.default_rng(0).integers(0, 255, (40, 60, 3), dtype=np.uint8)
    with sheet(tmp_path / "picture.png", (320, 200), "") as figure:
        place_image(figure, image, 100, 120)
    np.testing.assert_allclose(pixels(tmp_path / "picture.png")[120:160, 100:160], image / 255, atol=1e-6)


@pytest.mark.parametrize("layout", ["none", "constrained"])
def test_a_title_that_is_too_long_is_made_smaller(layout: str, tmp_path: Path) -> None:
    for words in ("short", "a title of very many words " * 6):
        with sheet(tmp_path / "picture.png", (640, 200), words, layout):
            pass
        ink = np.flatnonzero(np.any(pixels(tmp_path / "picture.png") < 0.5, axis=(0, 2)))
        assert ink.size > 20
        assert 0.005 * 640 < ink.min()
        assert ink.max() < 0.995 * 640


def test_settings_of_the_user_neither_matter_nor_change(tmp_path: Path) -> None:
    with sheet(tmp_path / "plain.png", (320, 200), "title"):
        pass
    with mpl.rc_context({"font.size": 40, "figure.facecolor": "black"}):
        before = dict(mpl.rcParams)
        with sheet(tmp_path / "odd.png", (320, 200), "title"):
            pass
        assert dict(mpl.rcParams) == before
    np.testing.assert_array_equal(pixels(tmp_path / "plain.png"), pixels(tmp_path / "odd.png"))


@pytest.mark.parametrize("name", ["picture.jpg", "picture"])
def test_only_png_files_are_written(name: str) -> None:
    with pytest.raises(InvalidInputError, match=r"pictures are PNG files, got the name .* end in '\.png'"):
        png_path(name)
