"""A picture is shown by Jupyter and stands for its file; on ranks that did not draw it shows nothing."""

from __future__ import annotations

import inspect
import os
from pathlib import Path
from typing import Any

import pytest
from IPython.core.formatters import DisplayFormatter

from fenics_contact import pictures as viz
from fenics_contact.errors import InvalidInputError
from fenics_contact.pictures import Picture, plot_curves
from fenics_contact.pictures.canvas import SHOWN_WIDTH

LINE: dict[str, Any] = {"series": {"line": ([0.0, 1.0], [0.0, 2.0])}, "xlabel": "x (mm)", "ylabel": "y (N)"}


def test_every_plot_function_writes_where_it_is_told_and_returns_a_picture() -> None:
    functions = {name: getattr(viz, name) for name in viz.__all__ if name.startswith("plot_")}
    assert len(functions) > 5, "hardly any functions were found: nothing was tested"
    for name, function in functions.items():
        signature = inspect.signature(function)
        assert signature.return_annotation == "Picture", name
        assert signature.parameters["path"].default is None, name
        assert signature.parameters["path"].annotation == "str | Path | None", name


def test_a_picture_without_a_path_writes_no_file(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.chdir(tmp_path)
    picture = plot_curves(**LINE, width=400)
    assert picture.png is not None
    assert picture.png.startswith(b"\x89PNG")
    assert picture.path is None
    assert str(picture) == "picture without a file"
    assert list(tmp_path.iterdir()) == []
    with pytest.raises(InvalidInputError, match=r"needs the file of a picture.*give the plot_ fun"):
        os.fspath(picture)


def test_a_written_picture_stands_for_its_file(tmp_path: Path) -> None:
    path = tmp_path / "folder" / "line.png"
    picture = plot_curves(**LINE, path=path, width=400)
    assert picture.path == path
    assert Path(picture) == path
    assert str(picture) == str(path)
    assert path.read_bytes() == picture.png
    assert picture.size == (400, 240)


def test_a_picture_is_written_whole_or_not_at_all(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    path = tmp_path / "line.png"
    path.write_bytes(b"old")

    def fail(*_: object) -> None:
        raise OSError("disk full")

    monkeypatch.setattr(os, "replace", fail)
    with pytest.raises(OSError, match="disk full"):
        plot_curves(**LINE, path=path, width=400)
    assert path.read_bytes() == b"old"
    assert list(tmp_path.iterdir()) == [path]


def test_jupyter_shows_a_picture_no_wider_than_a_notebook() -> None:
    for pixels, shown in ((1600, SHOWN_WIDTH), (400, 400)):
        picture = plot_curves(**LINE, width=pixels)
        data, metadata = DisplayFormatter().format(picture)
        assert data["image/png"] == picture.png
        assert metadata["image/png"] == {"width": shown}


def test_a_rank_that_did_not_draw_shows_nothing() -> None:
    picture = Picture(None, Path("line.png"))
    data, _ = DisplayFormatter().format(picture)
    assert data == {"text/plain": ""}
    assert picture.size is None
    assert str(picture) == "line.png"
