"""Scene files whose contact pairs the scene finds."""

from __future__ import annotations

import re
from pathlib import Path

import pytest
from mpi4py import MPI

from fenics_contact import Coulomb, read_scene_file
from fenics_contact._scene_file.reading import SceneFile
from fenics_contact._scene_file.source import SceneFileError
from tests.scene_file.texts import GOOD

SELF = MPI.COMM_SELF
PAIR = re.compile(r"\[\[contacts\]\].*?\n\n", re.DOTALL)
FOUND = '[automatic_contact]\nfriction = { law = "coulomb", coefficient = 0.2 }\n\n'


def read(text: str, folder: Path) -> SceneFile:
    path = folder / "scene.toml"
    path.write_text(text)
    return read_scene_file(path, SELF)


def test_pairs_are_found_in_place_of_those_of_the_file(tmp_path: Path) -> None:
    file = read(PAIR.sub(FOUND, GOOD), tmp_path)
    (pair,) = file.scene.contacts
    assert pair.place == "upper near lower on lower near upper"
    assert pair.friction == Coulomb(0.2)
    assert file.partitions.keys() == {"lower", "upper"}


def test_files_name_bodies_that_may_meet_themselves(tmp_path: Path) -> None:
    contact = '[automatic_contact]\nself_contact = ["lower"]\n\n'
    with pytest.raises(SceneFileError, match="of body 'lower' with itself needs a material for large"):
        _ = read(PAIR.sub(contact, GOOD), tmp_path).scene


@pytest.mark.parametrize(
    ("text", "message"),
    [
        (GOOD + "\n" + FOUND, r"automatic_contact: .*got both, 1 of the latter: leave one of them out"),
        (
            PAIR.sub("[automatic_contact]\ndistance = 0.1\n\n", GOOD).replace(
                "0.5, 0.5, 1.0]", "0.5, 0.5, 1.9]"
            ),
            r"automatic_contact: Automatic contact needs bodies that face each other .* finds none",
        ),
        (PAIR.sub("[automatic_contact]\ndistance = -1.0\n\n", GOOD), r"automatic_contact\.distance .*-1\.0"),
    ],
)
def test_what_finds_no_pair_is_refused(text: str, message: str, tmp_path: Path) -> None:
    with pytest.raises(SceneFileError, match=message):
        _ = read(text, tmp_path).scene
