"""What a wheel holds, and that the command finds it there."""

from __future__ import annotations

import subprocess
import sys
import tarfile
import tomllib
import zipfile
from pathlib import Path

import pytest

from fenics_contact import clean_environment
from tests.conftest import ROOT


def packages() -> list[str]:
    """Return the packages that pyproject.toml lists."""
    project = tomllib.loads((ROOT / "pyproject.toml").read_text())
    listed: list[str] = project["tool"]["setuptools"]["packages"]
    return listed


def test_every_package_is_listed() -> None:
    folders = sorted(path.parent for path in (ROOT / "fenics_contact").rglob("__init__.py"))
    there = [".".join(folder.relative_to(ROOT).parts) for folder in folders]
    assert len(there) > 10
    assert sorted(packages()) == sorted([*there, "fenics_contact.demos"])


@pytest.mark.slow
def test_the_source_distribution_is_the_project(tmp_path: Path) -> None:
    def run(*command: object, folder: Path = tmp_path) -> str:
        answer = subprocess.run(
            list(map(str, command)), capture_output=True, text=True, cwd=folder, check=False,
            env=clean_environment() | {"PYTHONPATH": str(tmp_path / "tools")},
        )  # fmt: skip
        assert answer.returncode == 0, answer.stdout + answer.stderr
        return answer.stdout

    source = tmp_path / "source"
    run("git", "clone", "-q", "--no-hardlinks", ROOT, source)
    tracked = set(run("git", "ls-files", folder=source).splitlines())
    (source / "tests" / "__pycache__").mkdir()
    (source / "tests" / "__pycache__" / "left.pyc").touch()
    try:
        run(sys.executable, "-m", "pip", "install", "-q", "--target", tmp_path / "tools", "setuptools>=77")
    except AssertionError as error:
        if "No matching distribution found for setuptools" in str(error):
            pytest.skip("the build needs setuptools from a package index, which cannot be reached")
        raise
    build = f"from setuptools.build_meta import build_sdist; build_sdist({str(tmp_path)!r})"
    run(sys.executable, "-c", build, folder=source)
    (archive,) = tmp_path.glob("*.tar.gz")
    files = [item.name.partition("/")[2] for item in tarfile.open(archive) if item.isfile()]
    assert set(files) - tracked - {"PKG-INFO", "setup.cfg"} == {
        name for name in files if name.startswith("fenics_contact.egg-info/")
    }
    assert {name for name in tracked - set(files) if not name.startswith((".ci/", ".git"))} == set()


@pytest.mark.slow
def test_an_installed_command_finds_its_demos(tmp_path: Path) -> None:
    environment = {name: value for name, value in clean_environment().items() if name != "PYTHONPATH"}

    def run(*command: object, folder: Path = tmp_path) -> str:
        answer = subprocess.run(
            list(map(str, command)), capture_output=True, text=True, env=environment, cwd=folder, check=False
        )
        assert answer.returncode == 0, answer.stdout + answer.stderr
        return answer.stdout

    source = tmp_path / "source"
    run("git", "clone", "-q", "--no-hardlinks", ROOT, source)  # what is not tracked must not be in the wheel
    try:
        run(sys.executable, "-m", "pip", "wheel", "-q", "--no-deps", "-w", tmp_path, source)
    except AssertionError as error:
        if "No matching distribution found for setuptools" in str(error):
            pytest.skip("the build needs setuptools from a package index, which cannot be reached")
        raise
    (wheel,) = tmp_path.glob("*.whl")
    names = zipfile.ZipFile(wheel).namelist()
    assert "fenics_contact/demos/demo_hertz_sphere.py" in names
    assert "fenics_contact/demos/scenes/two_blocks.toml" in names
    assert "fenics_contact/demos/scenes/scene_file.schema.json" in names
    assert "fenics_contact/py.typed" in names
    assert not [name for name in names if name.startswith(("demos/", "tests/"))]

    place = tmp_path / "installed"
    run(sys.executable, "-m", "pip", "install", "-q", "--no-deps", "--target", place, wheel)
    environment["PYTHONPATH"] = str(place)
    command = ("-m", "fenics_contact")
    found = run(sys.executable, "-c", "import fenics_contact; print(fenics_contact.__file__)")
    assert found.startswith(str(place))
    assert "hertz_sphere" in run(sys.executable, *command, "demo")
    assert "total potential" in run(sys.executable, *command, "demo", "two_blocks.toml")
    assert (tmp_path / "output" / "two_blocks" / "stress.png").exists()
