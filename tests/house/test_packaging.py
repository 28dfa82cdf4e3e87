"""What pip installs is pinned, on both Debian releases."""

from __future__ import annotations

import re
import tomllib
from contextlib import suppress
from importlib import metadata
from pathlib import Path

import pytest

from fenics_contact._base import requirements
from tests.conftest import ROOT
from tests.docs.pages import links_of

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


#: Names on conda-forge that differ from those of pip; what the system provides elsewhere is named there, too.
CONDA = {"matplotlib": "matplotlib-base", "gmsh": "python-gmsh", "dolfinx": "fenics-dolfinx"}


def oldest(lines: list[str]) -> dict[str, str]:
    """Return the oldest versions of ``name>=version`` or ``name >=version``, by the name."""
    split = (re.fullmatch(r"([\w-]+) ?>=([\d.]+)", line.partition(" #")[0]) for line in lines)
    return {found[1]: found[2] for found in split if found}


def test_the_recipe_asks_for_what_the_package_needs() -> None:
    project = tomllib.loads((ROOT / "pyproject.toml").read_text())["project"]
    recipe = (ROOT / "packaging" / "recipe.yaml").read_text()
    run = recipe.partition("  run:\n")[2].partition("\n\n")[0]
    asked = oldest(re.findall(r"^    - (.*)$", run, re.MULTILINE))
    extras = project["optional-dependencies"]
    needed = oldest([*project["dependencies"], *extras["cli"], *extras["viz"]])
    others = requirements._MPI4PY, requirements._PETSC4PY, requirements._GMSH
    needed |= {each.module: each.oldest for each in others} | {"dolfinx": asked["fenics-dolfinx"]}
    assert len(needed) > 10
    assert asked == {CONDA.get(name, name): version for name, version in needed.items()}
    assert f'\n  version: {project["version"]}\n' in recipe
    assert f'python_min: "{project["requires-python"].removeprefix(">=")}"' in recipe
    assert "petsc * real*" in run
    assert f"{project['scripts'].popitem()[1]}\n" in recipe


def test_the_page_of_the_package_index_needs_no_file() -> None:
    project = tomllib.loads((ROOT / "pyproject.toml").read_text())["project"]
    page = (ROOT / project["readme"]).read_text()
    assert links_of(page) == [], "an index shows no file of the project"
    scene = re.compile(r"```python\n.*?```", re.DOTALL)
    assert scene.findall(page) == scene.findall((ROOT / "README.md").read_text())
    for extra in re.findall(r"fenics_contact\[([\w,]+)\]", page):
        assert set(extra.split(",")) <= set(project["optional-dependencies"])


@pytest.mark.parametrize("page", ["packaging/index_page.md", "docs/guide/installing.md", "docs/licences.md"])
def test_the_wheel_is_offered_as_what_it_is(page: str) -> None:
    paragraphs = (ROOT / page).read_text().replace("|\n", "|\n\n").split("\n\n")
    offers = [words for words in paragraphs if "dolfinx-solver-real" in words]
    assert offers != []
    assert all("third part" in words.lower() and "alpha" in words for words in offers)


def licences() -> dict[str, str]:
    """Return the licence of every library that the page names."""
    rows = re.findall(r"^\| ([^|]+) \| ([^|]+) \|", (ROOT / "docs" / "licences.md").read_text(), re.MULTILINE)
    return {name: licence for names, licence in rows for name in re.split(r", |: ", names)}


def test_the_licence_of_every_dependency_is_listed() -> None:
    project = tomllib.loads((ROOT / "pyproject.toml").read_text())["project"]
    extras = project["optional-dependencies"]
    lines = [*project["dependencies"], *extras["cli"], *extras["viz"], *extras["wheel"]]
    assert {re.split(r"[^\w.-]", line)[0] for line in lines} - set(licences()) == set()


def test_licences_are_those_of_the_metadata() -> None:
    compared = 0
    for name, licence in licences().items():
        with suppress(metadata.PackageNotFoundError):
            known = metadata.metadata(name)
            fields = ("License-Expression", "License", "Classifier")
            stated = " ".join(text for field in fields for text in known.get_all(field) or [])
            kind = licence.partition("-")[0].partition(" ")[0]  # of "BSD-3-Clause" only "BSD" is everywhere
            compared += 1
            assert kind in stated or kind == "Matplotlib's", f"{name}: {licence}, but {stated[:300]}"
    assert compared > 8
