"""What the site makes of docstrings, signatures and scripts."""

from __future__ import annotations

import sys
from dataclasses import dataclass, field
from enum import Enum
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np
import pytest
from matplotlib.image import imread, imsave

from tests.docs.pages import DOCS, ROOT

sys.path.append(str(DOCS))
from _site import docstrings, reference, signatures, thumbnails

if TYPE_CHECKING:
    from numpy.typing import NDArray

    Vector = NDArray[Any]


@dataclass
class Values:
    """Values.

    Attributes:
        first: The first.
        more: The others.
    """

    first: Vector
    more: dict[str, int] = field(default_factory=dict)

    def of(self, name: str = "all", *, strict: bool = False) -> Vector | None:
        """Return some."""


class Colour(Enum):
    RED = 1


def written(obj: Any) -> tuple[str, str | None] | None:
    return signatures.as_written(None, "", "", obj, None, "()", None)  # type: ignore[arg-type]


def test_signatures_are_those_of_the_source() -> None:
    assert written(Values) == ("(first: np.ndarray, more: dict[str, int] = ...)", None)
    assert written(Values.of) == ("(name: str = 'all', *, strict: bool = False)", "np.ndarray | None")


def test_a_default_of_several_lines_is_three_dots() -> None:
    def cut(mesh: str, table: object = np.array([[1], [2]])) -> None: ...

    assert "\n" in repr(np.array([[1], [2]]))
    assert written(cut) == ("(mesh: str, table: object = ...)", "None")


def test_nobody_calls_an_enumeration() -> None:
    assert written(Colour) == ("", None)


def test_attributes_have_their_types_beside_their_names() -> None:
    lines = docstrings.types_beside_names(
        [".. attribute:: first", "", "   The first."],
        signatures.annotations(Values),  # type: ignore[attr-defined]
    )
    assert lines == [".. attribute:: first", "   :type: np.ndarray", "", "   The first."]


def test_tables_of_docstrings_become_tables() -> None:
    lines = docstrings.tables(
        ["Stops:", "", "| when | why |", "|---|---|", "| w is small | DONE |", "", "End."]
    )
    assert [line.strip() for line in lines] == [
        *("Stops:", "", ".. list-table::", ":widths: auto", ":header-rows: 1", ""),
        *("* - when", "- why", "* - w is small", "- DONE", "", "", "End."),
    ]


def test_the_text_of_a_property_is_no_type() -> None:
    lines = ["Volume of the link: section times length."]
    docstrings.hide_colons(None, "property", "", None, None, lines)  # type: ignore[arg-type]
    assert ":" not in lines[0]
    docstrings.finish(None, "property", "", None, None, lines)  # type: ignore[arg-type]
    assert lines == ["Volume of the link: section times length."]


def test_a_name_has_one_place() -> None:
    places = [(name, room) for room in reference.rooms() for name in reference.homes(room)]
    assert reference.homes("fenics_contact")["minimize"] == "fenics_contact.minimize"
    assert len({name for name, _ in places}) == len(places) > 200


NAMES = ["fenics_contact.mesh.body_mesh.BodyMesh", "BodyMesh", "fenics_contact.BodyMesh"]


@pytest.mark.parametrize("target", NAMES)
def test_a_class_is_found_by_every_name_that_it_has(target: str) -> None:
    found = [*reference.candidates(target), target]
    assert "fenics_contact.BodyMesh" in found


def test_the_comment_above_a_constant_describes_it() -> None:
    text, value = reference.constant(reference.module_of("study"), "BALANCED")
    assert text[0]
    assert value


def test_pages_of_the_reference_are_made_and_not_kept() -> None:
    assert "/docs/reference/" in (ROOT / ".gitignore").read_text().splitlines()


def test_thumbnails_are_pieces_of_pictures_of_one_size(tmp_path: Path) -> None:
    image = np.ones((100, 200, 3))
    image[:4] = 0.0  # the title
    image[20:80, 40:120, 1:] = 0.0
    image[:, 180:] = 0.0  # the bar
    imsave(tmp_path / "new.png", image)
    target = thumbnails.write_thumbnail(tmp_path / "new.png", tmp_path)
    found = imread(target)[..., :3]
    assert found.shape == (400, 600, 3)
    assert np.all(found[200, 300] == [1, 0, 0])
    assert not np.any(np.all(found < 0.5, axis=-1)), "title and bar are cut off"
    written = target.stat().st_mtime_ns
    assert thumbnails.write_thumbnail(tmp_path / "new.png", tmp_path) == target
    assert target.stat().st_mtime_ns == written, "the same one is not written again"


def test_pieces_are_those_of_pictures_that_are_there() -> None:
    assert set(thumbnails.PIECES) <= {picture.stem for picture in (DOCS / "pictures").rglob("*.png")}
    for name, (left, top, right, bottom) in thumbnails.PIECES.items():
        assert 0 <= left < right <= 1, name
        assert 0 <= top < bottom <= 1, name
