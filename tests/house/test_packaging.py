"""What pip installs is pinned, on both Debian releases."""

from __future__ import annotations

import re
import tomllib
from pathlib import Path

import pytest

from tests.conftest import ROOT

RELEASES = sorted((ROOT / "constraints").glob("*.txt"))


def pins(path: Path) -> dict[str, str]:
    """Return the versions that a constraints file gives, by the normalised name of the distribution."""
    lines = [line for line in path.read_text().splitlines() if line and not line.startswith("#")]
    assert [line for line in lines if not re.fullmatch(r"[\w.-]+==[\w.]+", line)] == [], "only name==version"
    return {normalised(name): version for name, version in (line.split("==") for line in lines)}


def normalised(name: str) -> str:
    """Return the form in which two spellings of a distribution's name are equal."""
    return re.sub(r"[-_.]+", "-", name).lower()


def asked_for() -> set[str]:
    """Return every distribution that pyproject.toml names, but for the extra in place of the system's."""
    project = tomllib.loads((ROOT / "pyproject.toml").read_text())
    lists = [project["build-system"]["requires"], project["project"]["dependencies"]]
    lists += [lines for name, lines in project["project"]["optional-dependencies"].items() if name != "wheel"]
    named = {normalised(re.split(r"[^\w.-]", line)[0]) for lines in lists for line in lines}
    return named - {normalised(project["project"]["name"])}  # an extra may contain another


def test_there_are_constraints_for_both_releases() -> None:
    assert [path.stem for path in RELEASES] == ["bookworm", "trixie"]


@pytest.mark.parametrize("path", RELEASES, ids=lambda path: path.stem)
def test_everything_asked_for_is_pinned(path: Path) -> None:
    assert len(asked_for()) > 5
    assert asked_for() - set(pins(path)) == set()


def test_what_the_system_provides_is_not_asked_for() -> None:
    assert asked_for() & {"fenics-dolfinx", "petsc4py", "mpi4py", "gmsh"} == set()


def test_releases_differ_only_in_what_debian_provides() -> None:
    bookworm, trixie = map(pins, RELEASES)
    differing = {name for name in bookworm.keys() | trixie.keys() if bookworm.get(name) != trixie.get(name)}
    assert differing == {"numpy", "scipy"}
