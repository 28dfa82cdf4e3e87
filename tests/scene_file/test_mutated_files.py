"""Scene files with random mistakes end with a sentence: no other error, no long wait, no memory gone."""

from __future__ import annotations

import resource
import time
from pathlib import Path

import pytest
from mpi4py import MPI

from fenics_contact import read_scene_file
from fenics_contact._base.progress import is_visible
from fenics_contact._cli.app import main
from fenics_contact._scene_file.source import SceneFileError
from fenics_contact.errors import InvalidInputError
from tests.scene_file.mutations import bases, mutated

QUICK, ALL = 150, 3000
#: Seconds and bytes that no file may take.
LONG, MUCH = 5.0, 2**30


def end(text: str, overrides: list[str], folder: Path) -> str:
    """Read and build a scene with all its steps; return what was said of it, "" where nothing is wrong."""
    path = folder / "scene.toml"
    path.write_bytes(text.encode("utf-8"))
    try:
        file = read_scene_file(path, MPI.COMM_SELF, overrides=overrides)
        _ = file.steps, file.partitions
    except InvalidInputError as error:
        return str(error)
    return ""


def check(seeds: range, folder: Path) -> int:
    """Return how many of the files were refused."""
    refused = 0
    for seed in seeds:
        text, overrides = mutated(seed)
        before = resource.getrusage(resource.RUSAGE_SELF).ru_maxrss
        begun = time.process_time()
        said = end(text, overrides, folder)
        assert time.process_time() - begun < LONG, seed
        assert 1024 * (resource.getrusage(resource.RUSAGE_SELF).ru_maxrss - before) < MUCH, seed
        assert is_visible(said), seed
        assert len(said) < 20_000, seed
        refused += bool(said)
    return refused


@pytest.mark.parametrize("name", bases())
def test_the_files_are_right_before_mistakes_are_made(name: str, tmp_path: Path) -> None:
    assert end(bases()[name], [], tmp_path) == ""


def test_files_with_random_mistakes_are_refused_with_a_sentence(tmp_path: Path) -> None:
    assert check(range(QUICK), tmp_path) > 0.5 * QUICK


@pytest.mark.slow
def test_thousands_of_files_with_random_mistakes_are_refused_with_a_sentence(tmp_path: Path) -> None:
    assert check(range(QUICK, ALL), tmp_path) > 0.5 * (ALL - QUICK)


def test_a_thousand_mistakes_are_found_in_a_moment(tmp_path: Path) -> None:
    text = bases()["good"] + '[[supports]]\nbody = "lower"\nsurface = "z0"\nvalu = 1\n' * 1000
    path = tmp_path / "scene.toml"
    path.write_text(text)
    begun = time.process_time()
    with pytest.raises(
        SceneFileError, match=r"has 1000 mistakes:\n  line 47: supports.1.valu is not"
    ) as error:
        read_scene_file(path, MPI.COMM_SELF)
    assert time.process_time() - begun < LONG
    assert [mistake.line for mistake in error.value.mistakes] == list(range(47, 4047, 4))
    assert str(error.value).endswith("\n  and 950 more")


@pytest.mark.parametrize(
    "data",
    [
        {"meshes": {1: {"shape": "block"}}},
        {"title": 10**5000},
        {"materials": {"a": {"young_modulus": 10**5000}}},
        {"solver": {"method": 10**5000}},
        {"bodies": {"a": {"mesh": object()}}},
        {"supports": ({"body": b"\x00"},)},
        {"\x1b[31m": None},
        {},
    ],
    ids=lambda data: " ".join(map(repr, data)),
)
def test_dictionaries_of_any_kind_are_refused_with_a_sentence(data: dict[object, object]) -> None:
    with pytest.raises(SceneFileError, match=r"^the scene"):
        read_scene_file(data, MPI.COMM_SELF)  # type: ignore[arg-type]


def test_what_is_no_scene_is_refused() -> None:
    with pytest.raises(
        InvalidInputError, match="a scene must be the path of a TOML file or a dictionary, got int"
    ):
        read_scene_file(3, MPI.COMM_SELF)  # type: ignore[arg-type]


@pytest.mark.parametrize("content", [b"", b"\xff\xfe", b"\xef\xbb\xbf", b"\0", b"a = 1\n\n\xff"])
def test_files_of_any_bytes_are_refused_with_a_sentence(
    content: bytes, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    path = tmp_path / "scene.toml"
    path.write_bytes(content)
    assert main(MPI.COMM_SELF, ["run", str(path), "--dry-run"]) == 2
    said = capsys.readouterr().err
    assert said.startswith("error: ")
    assert "Traceback" not in said
    assert "line 3 is not" in said or b"a = 1" not in content
