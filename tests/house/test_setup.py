"""The set-up chooses between packages of the system and the wheel, and states what it needs."""

from __future__ import annotations

import importlib.util
import os
import re
import shutil
import sys
from pathlib import Path
from types import ModuleType

import pytest

from fenics_contact._base.launching import FinishedProcess, finished
from tests.conftest import ROOT

SCRIPTS = ROOT / "scripts"


class Machine:
    """A copy of the scripts on a machine whose system, packages and user are as a test says."""

    def __init__(self, folder: Path) -> None:
        self.folder, self.programs, self.release = folder / "tree", folder / "bin", folder / "os-release"
        self.programs.mkdir()
        for name in ("scripts", "constraints"):
            shutil.copytree(ROOT / name, self.folder / name, ignore=shutil.ignore_patterns("__pycache__"))
        self.program("sudo", "exit 1")
        self.program("id", "echo 1000")
        self.program("python3", "exit 1")
        self.program("apt-cache", "exit 100")
        self.has_packages("")
        self.system('ID=debian\nVERSION_ID="13"\nPRETTY_NAME="Debian 13"\n')

    def program(self, name: str, script: str) -> None:
        """Put a program first on PATH."""
        path = self.programs / name
        path.write_text(f"#!/bin/sh\n{script}\n")
        path.chmod(0o755)

    def system(self, text: str) -> None:
        """Write what the file os-release of the system contains."""
        self.release.write_text(text)

    def has_packages(self, pattern: str) -> None:
        """Let packages be installed whose name, the last argument, matches a pattern of the shell."""
        script = f'for name; do :; done; case "$name" in {pattern or "none"}) printf installed;; esac'
        self.program("dpkg-query", script)

    def has_python_for_the_wheel(self) -> None:
        """Put a Python first on PATH that has what the wheel needs."""
        self.program("python3", 'case "$1" in -c) echo "$0";; esac')

    def plan(self, *arguments: str, wheel: str = "") -> FinishedProcess:
        """Return what ``setup.sh --plan`` does."""
        path = f"{self.programs}:{os.environ['PATH']}"
        environment = os.environ | {"PATH": path, "OS_RELEASE": str(self.release), "WHEEL": wheel}
        command = ["bash", str(self.folder / "scripts" / "setup.sh"), "--plan", *arguments]
        return finished(command, 60.0, environment=environment)


@pytest.fixture
def machine(tmp_path: Path) -> Machine:
    return Machine(tmp_path)


@pytest.mark.parametrize(
    "release",
    [
        'ID=debian\nVERSION_ID="12"\n',
        'ID=debian\nVERSION_ID="14"\n',
        'ID=debian\nPRETTY_NAME="forky/sid"\n',
        'ID=ubuntu\nVERSION_ID="25.04"\n',
        'ID=ubuntu\nVERSION_ID="26.10"\n',
    ],
)
def test_debian_and_ubuntu_take_their_packages(machine: Machine, release: str) -> None:
    machine.system(release)
    machine.has_packages("*")
    assert machine.plan().output == "packages with /usr/bin/python3; missing:\n"


@pytest.mark.parametrize(
    "release",
    [
        'ID=debian\nVERSION_ID="11"\n',
        'ID=ubuntu\nVERSION_ID="22.04"\n',
        'ID=ubuntu\nVERSION_ID="24.04"\n',
        'ID=fedora\nVERSION_ID="43"\n',
        "",
    ],
)
def test_another_system_is_refused_with_both_cures(machine: Machine, release: str) -> None:
    machine.system(release)
    answer = machine.plan()
    assert (answer.status, answer.output) == (1, "")
    assert "Debian 12 or newer or Ubuntu 25.04 or newer (24.04 with ppa:" in answer.errors
    for part in ("PYTHON=/path/to/python", "WHEEL=1", "third party"):
        assert part in answer.errors


def test_ubuntu_24_takes_packages_of_another_archive_or_the_wheel_with_all_it_needs(machine: Machine) -> None:
    machine.system('ID=ubuntu\nVERSION_ID="24.04"\n')
    machine.has_python_for_the_wheel()
    machine.program("sudo", "exit 0")
    needed = machine.plan(wheel="1").output
    assert needed.startswith("wheel with /")
    assert "python3-dev" in needed
    machine.program("apt-cache", '[ "$1 $2" = "show python3-dolfinx-real" ]')
    assert machine.plan().output.startswith("packages with /usr/bin/python3; missing: python3-dolfinx-real ")


def test_another_system_takes_the_wheel_where_asked(machine: Machine) -> None:
    machine.system("ID=fedora\nVERSION_ID=43\n")
    machine.has_python_for_the_wheel()
    assert machine.plan(wheel="1").output.startswith("wheel with /")


def test_without_root_and_packages_the_wheel_is_taken(machine: Machine) -> None:
    machine.has_python_for_the_wheel()
    answer = machine.plan()
    assert answer.output.startswith("wheel with /")
    assert "apt-get install --no-install-recommends python3-dolfinx-real" in answer.errors


def test_with_root_the_packages_are_installed(machine: Machine) -> None:
    machine.has_python_for_the_wheel()
    machine.has_packages("*-venv")
    machine.program("sudo", "exit 0")
    answer = machine.plan("chromium")
    assert answer.output.startswith("packages with /usr/bin/python3; missing: python3-dolfinx-real ")
    assert "python3-venv" not in answer.output
    assert answer.output.endswith(" chromium\n")


@pytest.mark.parametrize("wheel", ["0", ""])
def test_without_root_and_python_what_is_missing_is_named(machine: Machine, wheel: str) -> None:
    machine.program("python3", "exit 1")
    python = machine.plan(wheel="1").output
    if wheel == "" and "no Python" not in python:
        pytest.skip("the system's own Python can use the wheel")
    answer = machine.plan(wheel=wheel)
    assert answer.status == 1
    assert "run as root" in answer.errors
    assert "python3-gmsh" in answer.errors
    assert "WHEEL=1" in answer.errors


def test_a_missing_browser_does_not_change_where_fenicsx_comes_from(machine: Machine) -> None:
    machine.has_python_for_the_wheel()
    machine.has_packages("python3-*|lib*|ca-*")
    answer = machine.plan("chromium")
    assert answer.status == 1
    assert "apt-get install --no-install-recommends chromium\n" in answer.errors


def test_what_was_made_by_the_wheel_stays_so(machine: Machine) -> None:
    machine.has_python_for_the_wheel()
    machine.has_packages("*")
    (machine.folder / ".venv").mkdir()
    (machine.folder / ".venv" / ".fenics_contact-wheel").touch()
    assert machine.plan().output.startswith("wheel with /")
    assert machine.plan(wheel="0").output.startswith("packages with /usr/bin/python3")


def test_what_is_not_known_is_refused(machine: Machine) -> None:
    assert "needs WHEEL=1, WHEEL=0 or none, got WHEEL=2" in machine.plan(wheel="2").errors
    answer = machine.plan("--fast")
    assert (answer.status, answer.output) == (2, "")
    assert "takes --dev, --plan and names of packages, got: --fast" in answer.errors


@pytest.fixture
def needs(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> ModuleType:
    """The script that finds what the wheel needs, as on a machine that has all."""
    spec = importlib.util.spec_from_file_location("wheel_needs", SCRIPTS / "wheel_needs.py")
    assert spec is not None
    assert spec.loader is not None
    module = importlib.util.module_from_spec(spec)
    spec.loader.exec_module(module)
    (tmp_path / "Python.h").touch()
    monkeypatch.setattr(module, "machine", lambda: ("3.13", "linux", "x86_64", "glibc 2.34"))
    monkeypatch.setattr(module, "headers", lambda: str(tmp_path))
    monkeypatch.setattr(module, "find_spec", lambda _: object())
    monkeypatch.setenv("CC", f"{sys.executable} -O")
    return module


def test_nothing_prevents_the_wheel_where_all_is_there(needs: ModuleType) -> None:
    assert needs.pythons() == ["3.12", "3.13", "3.14"]
    assert needs.obstacles() == []


def test_everything_that_the_wheel_needs_is_named(needs: ModuleType, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(needs, "machine", lambda: ("3.11", "linux", "x86_64", "glibc 2.31"))
    monkeypatch.setattr(needs, "headers", lambda: "/nowhere")
    monkeypatch.setattr(needs, "find_spec", lambda _: None)
    monkeypatch.setenv("CC", "no-such-compiler -O")
    found = "\n".join(needs.obstacles())
    assert "found 3.11" in found
    assert "glibc 2.34 or newer, found glibc 2.31" in found
    for part in ("python3-venv", "python3-dev", "no-such-compiler"):
        assert part in found
    monkeypatch.setattr(needs, "machine", lambda: ("3.13", "linux", "aarch64", "glibc 2.41"))
    assert "Linux on x86-64, found linux on aarch64" in needs.obstacles()


def test_libraries_that_cannot_be_loaded_are_named(
    needs: ModuleType, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(needs, "LIBRARIES", {"libc.so.6": "libc6", "libnowhere.so.9": "libnowhere9"})
    assert needs.missing_libraries() == ["libnowhere9"]


def test_the_launcher_needs_no_newer_bash_than_that_of_macos() -> None:
    for name in ("launch.sh", "setup.sh"):
        script = re.sub(r"(^|\s)#.*", "", (SCRIPTS / name).read_text())
        assert "while" in script
        newer = r"\bmapfile\b|\breadarray\b|declare -A|\$\{\w+(,,|\^\^|@[A-Z])|\|&|&>>"
        assert re.findall(newer, script) == []
