"""Runs killed at chosen or random moments leave whole files and end with the answer of one that is not."""

from __future__ import annotations

import json
import random
import re
import sys
import xml.etree.ElementTree as ET
from functools import cache
from pathlib import Path
from typing import Any

import numpy as np
import pytest
import pyvista as pv

from fenics_contact.output import read_result
from tests.conftest import launch

pytestmark = pytest.mark.slow

SCRIPT = Path(__file__).with_name("killed_run.py")
#: Longest time after which a run is killed at random, [ms].
LONGEST = {"steps": 600, "optimisation": 1500}
SERIES = {"steps": "steps", "optimisation": "designs"}
#: Where runs are killed, one after the other: moment, how often it has come by then (or milliseconds), rank.
ALONE = [
    ("in a VTU file", 1, 0),
    ("in a checkpoint", 1, 0),
    ("before a file gets its name", 2, 0),
    ("in an HDF5 file", 2, 0),
    ("in an index", 2, 0),
    ("before a file is removed", 1, 0),
    ("in a solve", 25, 0),
    ("before a file gets its name", 9, 0),
]
TOGETHER = [
    ("in an HDF5 file", 5, 1),
    ("in a solve", 30, 1),
    ("in a checkpoint", 2, 0),
    ("in an HDF5 file", 4, 0),
]


def ended(kind: str, folder: Path, ranks: int = 1, moment: tuple[str, int, int] | None = None) -> bool:
    """Run and tell whether it came to its end; anything else than the kill that was ordered is an error."""
    end = launch(ranks, SCRIPT, kind, folder, *(moment or ()), timeout=300.0)
    if end.returncode == 0:
        return True
    killed = end.returncode in (-9, 137) or "signal 9" in end.stderr
    assert moment, end.stderr
    assert killed, f"exit status {end.returncode}: {end.stderr}"
    return False


def whole_files(folder: Path) -> int:
    """Parse every file of a folder to its end and return how many there were."""
    count = 0
    for path in sorted(folder.rglob("*")):
        if path.is_dir() or any(part.startswith(".") for part in path.relative_to(folder).parts):
            continue
        count += 1
        match path.suffix:
            case ".json":
                json.loads(path.read_text())
            case ".npz":
                with np.load(path) as members:
                    assert all(members[name] is not None for name in members.files)
            case ".pvd":
                named = [entry.attrib["file"] for entry in ET.parse(path).getroot().iter("DataSet")]
                assert all((folder / name).is_file() for name in named)
            case ".vtm":
                named = [entry.attrib["file"] for entry in ET.parse(path).getroot().iter("DataSet")]
                assert all((path.parent / name).is_file() for name in named)
            case ".vtu":
                assert pv.read(path).n_points > 0
            case ".xdmf":
                names = [str(item.text).partition(":")[0] for item in ET.parse(path).iter("DataItem")]
                assert all((path.parent / name).is_file() for name in names)
                assert pv.read(path) is not None
            case ".h5":
                assert path.read_bytes()[1:4] == b"HDF"
            case _:
                pytest.fail(f"{path} is of no known kind")
    return count


def hidden(folder: Path) -> list[Path]:
    return [path for path in folder.rglob(".*") if path.name.endswith(".partial")]


@cache
def answer(kind: str, folder: Path) -> dict[str, Any]:
    """Return the result of a run on one rank that nobody kills."""
    assert ended(kind, folder)
    return read_result(folder)


@pytest.fixture(scope="module")
def uninterrupted(tmp_path_factory: pytest.TempPathFactory) -> dict[str, dict[str, Any]]:
    folders = {kind: tmp_path_factory.mktemp(kind) for kind in SERIES}
    return {kind: answer(kind, folder) for kind, folder in folders.items()}


def largest_difference(one: Any, other: Any) -> float:
    """Compare two arrays relative to the largest number."""
    first, second = np.array(one), np.array(other)
    assert first.shape == second.shape
    assert np.abs(second).max() > 0
    return float(np.abs(first - second).max() / np.abs(second).max())


def assert_same(kind: str, folder: Path, whole: dict[str, Any], tolerance: float) -> dict[str, float]:
    """Compare a run that was killed with one that was not, and return the differences."""
    found = read_result(folder)
    same = {name: largest_difference(found["more"][name], whole["more"][name]) for name in whole["more"]}
    for name in ("strain", "total_potential"):
        same[name] = largest_difference([found["energies"][name]], [whole["energies"][name]])
    values = pv.get_reader(folder / f"{SERIES[kind]}.pvd").time_values
    if kind == "steps":
        assert values == list(range(7))
    else:
        mine, theirs = found["optimisation"], whole["optimisation"]
        assert mine["history"]["kind"] == theirs["history"]["kind"]
        same["values"] = largest_difference(mine["history"]["value"], theirs["history"]["value"])
        same["design"] = largest_difference(mine["design"]["values"], theirs["design"]["values"])
        better = [k for k, what in enumerate(mine["history"]["kind"], 1) if what in ("start", "serious")]
        assert values == better
        assert len(better) > 2
    sys.stdout.write(f"{kind}: largest differences {same}\n")
    assert max(same.values()) <= tolerance, same
    assert hidden(folder) == [], "what killed runs have left is gone"
    return same


def killed_at(kind: str, folder: Path, moments: list[tuple[str, int, int]], ranks: int) -> int:
    """Run once for each moment, look at the files after each, and return how many runs were killed."""
    kills, seen = 0, 0
    for moment in moments:
        assert not ended(kind, folder, ranks, moment), f"the run did not come to {moment}"
        kills += 1
        seen = max(seen, whole_files(folder))
        assert len(hidden(folder)) <= 2, "what killed runs leave piles up"
    assert seen >= 3, "hardly any files were there: nothing was tested"
    return kills


@pytest.mark.parametrize("kind", SERIES)
def test_a_run_killed_at_chosen_moments_goes_on_to_the_same_answer(
    kind: str, uninterrupted: dict[str, dict[str, Any]], tmp_path: Path
) -> None:
    kills = killed_at(kind, tmp_path, ALONE, 1)
    assert kills == len(ALONE)
    assert ended(kind, tmp_path)
    whole_files(tmp_path)
    same = assert_same(kind, tmp_path, uninterrupted[kind], 1e-9)
    assert np.isfinite(list(same.values())).all()


@pytest.mark.parametrize("kind", SERIES)
def test_a_run_killed_at_random_moments_goes_on_to_the_same_answer(
    kind: str, uninterrupted: dict[str, dict[str, Any]], tmp_path: Path
) -> None:
    chance, kills = random.Random(7), 0
    for _ in range(20):
        if ended(kind, tmp_path, 1, ("after a time", chance.randrange(20, LONGEST[kind]), 0)):
            break
        kills += 1
        whole_files(tmp_path)
        assert len(hidden(tmp_path)) <= 2
    else:
        assert ended(kind, tmp_path)
    sys.stdout.write(f"{kind}: killed {kills} times at random moments\n")
    assert kills > 2
    assert_same(kind, tmp_path, uninterrupted[kind], 1e-9)


@pytest.mark.parametrize("kind", SERIES)
def test_when_one_of_two_ranks_is_killed_the_run_goes_on_on_two_ranks_and_on_one(
    kind: str, uninterrupted: dict[str, dict[str, Any]], tmp_path: Path
) -> None:
    kills = killed_at(kind, tmp_path, TOGETHER, 2)
    kills += killed_at(kind, tmp_path, [("in an index", 2, 0)], 1)
    assert kills == len(TOGETHER) + 1
    assert ended(kind, tmp_path, 2)
    whole_files(tmp_path)
    assert read_result(tmp_path)["ranks"] == 2
    assert_same(kind, tmp_path, uninterrupted[kind], 1e-5)


def test_the_moments_are_all_tried() -> None:
    source = SCRIPT.read_text()
    moments = set(re.findall(r'^    "([a-z].*?)": \(', source, re.M))
    assert len(moments) == 7
    assert moments == {moment for moment, _, _ in ALONE}
