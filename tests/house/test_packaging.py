"""What pip installs is pinned with hashes, for every Python of Debian and Ubuntu, and nothing is left out."""

from __future__ import annotations

import re
import sys
import tomllib
from contextlib import suppress
from importlib import metadata
from pathlib import Path

import pytest
from packaging.requirements import Requirement

from fenics_contact._base import requirements
from tests.conftest import ROOT
from tests.docs.pages import links_of

PYTHONS = sorted((ROOT / "constraints").glob("python3.*"))
SYSTEM = {"dolfinx-solver-real", "fenics-ffcx", "gmsh", "mpi4py", "mpich", "numpy", "scipy", "setuptools"}
"""What the system has where its FEniCSx is used; pip must not put others over it."""


def pins(path: Path) -> dict[str, str]:
    """Return the versions that a list gives, by the normalised name of the distribution."""
    text = re.sub(r"^#.*\n|^\n", "", path.read_text(), flags=re.MULTILINE)
    pin = r"[\w.-]+==[\w.]+(?: \\\n    --hash=sha256:[0-9a-f]{64})+\n"
    assert re.sub(pin, "", text) == "", "only name==version with hashes"
    found = re.findall(r"^([\w.-]+)==([\w.]+)", text, re.MULTILINE)
    return {normalised(name): version for name, version in found}


def normalised(name: str) -> str:
    """Return the form in which two spellings of a distribution's name are equal."""
    return re.sub(r"[-_.]+", "-", name).lower()


def asked_for(*extras: str) -> set[str]:
    """Return every distribution that pyproject.toml names for the build, the package and some extras."""
    project = tomllib.loads((ROOT / "pyproject.toml").read_text())
    lists = [project["build-system"]["requires"], project["project"]["dependencies"]]
    lists += [project["project"]["optional-dependencies"][extra] for extra in extras]
    named = {normalised(re.split(r"[^\w.-]", line)[0]) for lines in lists for line in lines}
    return named - {normalised(project["project"]["name"])}  # an extra may contain another


def test_every_python_of_debian_and_ubuntu_has_its_lists() -> None:
    assert [path.name for path in PYTHONS] == ["python3.11", "python3.12", "python3.13", "python3.14"]
    lists = [{path.stem for path in folder.iterdir()} for folder in PYTHONS]
    every = {"build", "demo", "dev"}
    assert lists == [every, *[every | {"wheel"}] * 3]  # the wheel needs Python 3.12


@pytest.mark.parametrize("folder", PYTHONS, ids=lambda path: path.name)
def test_everything_asked_for_is_pinned(folder: Path) -> None:
    demo, dev = pins(folder / "demo.txt").keys(), pins(folder / "dev.txt").keys()
    assert len(asked_for("cli", "viz") - SYSTEM) > 5
    assert asked_for("cli", "viz") - SYSTEM <= demo
    assert asked_for("notebooks", "docs", "test") - SYSTEM <= dev | demo
    assert pins(folder / "build.txt").keys() == {"setuptools"}


@pytest.mark.parametrize("folder", PYTHONS, ids=lambda path: path.name)
def test_what_the_system_provides_is_installed_with_the_wheel_alone(folder: Path) -> None:
    demo, dev = pins(folder / "demo.txt").keys(), pins(folder / "dev.txt").keys()
    assert (demo | dev) & SYSTEM == set()
    if (folder / "wheel.txt").exists():
        assert pins(folder / "wheel.txt").keys() | demo >= SYSTEM | asked_for("wheel")


@pytest.mark.parametrize("folder", PYTHONS, ids=lambda path: path.name)
def test_what_demos_need_is_free_of_the_tools_of_developers(folder: Path) -> None:
    lists = [set(pins(path)) for path in folder.iterdir() if path.stem != "build"]
    assert sum(map(len, lists)) == len(set.union(*lists)), "a distribution is in one list"
    tools = {"pytest", "mypy", "ruff", "jupyterlab", "sphinx", "pymetis"}
    assert tools & pins(folder / "demo.txt").keys() == set()
    assert tools <= pins(folder / "dev.txt").keys()


def closure(extras: set[str]) -> set[str]:
    """Return all distributions that the package with some extras needs here, as what is installed says."""
    waiting, seen = [(name, "") for name in asked_for(*extras) - SYSTEM], set()
    while waiting:
        name, extra = waiting.pop()
        if (name, extra) in seen:
            continue
        seen.add((name, extra))
        for requirement in map(Requirement, metadata.requires(name) or []):
            if requirement.marker is None or requirement.marker.evaluate({"extra": extra}):
                waiting += [(normalised(requirement.name), each) for each in ("", *requirement.extras)]
    return {name for name, _ in seen}


@pytest.mark.parametrize(
    ("extras", "lists"),
    [({"cli", "viz"}, ["demo"]), ({"cli", "docs", "notebooks", "test", "viz"}, ["demo", "dev"])],
)
def test_lists_contain_what_their_contents_need(extras: set[str], lists: list[str]) -> None:
    folder = ROOT / "constraints" / f"python3.{sys.version_info.minor}"
    if not folder.exists():
        pytest.skip("no list for this Python")
    needed = closure(extras)
    assert len(needed) > 20
    assert needed - SYSTEM <= {name for each in lists for name in pins(folder / f"{each}.txt")}


def test_without_the_extra_no_dolfinx_is_asked_for() -> None:
    named = asked_for("cli", "viz", "notebooks", "docs", "test", "dev")
    assert named & SYSTEM == {"numpy", "scipy", "setuptools"}


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
    assert f"\n  version: {project['version']}\n" in recipe
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
            words = " ".join(text for field in fields for text in known.get_all(field) or []).split()
            stated = " ".join(words).replace("GNU Lesser General Public License", "LGPL")
            kind = licence.partition("-")[0].partition(" ")[0]  # of "BSD-3-Clause" only "BSD" is everywhere
            if not stated:  # Debian 13 leaves the field out
                continue
            compared += 1
            assert kind in stated or kind == "Matplotlib's", f"{name}: {licence}, but {stated[:300]}"
    assert compared > 8
