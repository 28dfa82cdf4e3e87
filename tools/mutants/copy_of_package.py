"""A copy of the project in a folder of its own, in which one text can be replaced and tests be run."""

from __future__ import annotations

import os
import shutil
import subprocess
import sys
from collections.abc import Iterator, Sequence
from contextlib import contextmanager
from dataclasses import dataclass
from pathlib import Path

from fenics_contact import clean_environment

ROOT = Path(__file__).parents[2]
#: What the tests of a mutation need.
PARTS = ("fenics_contact", "tests", "tools", "benchmarks", "demos", "pyproject.toml", "scripts")
#: Seconds that the tests of one mutation may take.
TIMEOUT = 900.0
#: What pytest's exit status means.
PASSED, FAILED = 0, 1


@dataclass(frozen=True)
class Mutation:
    """A mistake that the quick tests must find.

    Attributes:
        mistake: What is wrong, in words.
        file: File of the package.
        text: What is replaced; it must occur exactly once.
        by: What it is replaced by.
        killers: Tests, one of which at least must fail.
    """

    mistake: str
    file: str
    text: str
    by: str
    killers: tuple[str, ...]


@dataclass(frozen=True)
class Run:
    """How tests ended: pytest's exit status and what it wrote."""

    status: int
    output: str


class Copy:
    """The copy. Its package is found before any that is installed."""

    def __init__(self, folder: Path) -> None:
        """Copy what tests need, without what was compiled."""
        self.folder = folder
        ignore = shutil.ignore_patterns("__pycache__", ".*_cache")
        for part in PARTS:
            source = ROOT / part
            if source.is_dir():
                shutil.copytree(source, folder / part, ignore=ignore)
            else:
                shutil.copy2(source, folder / part)

    @property
    def environment(self) -> dict[str, str]:
        """The environment of a process that shall use the copy and keep what it compiles."""
        return clean_environment() | {"PYTHONPATH": str(self.folder), "PYTHONDONTWRITEBYTECODE": ""}

    @contextmanager
    def mutated(self, mutation: Mutation) -> Iterator[None]:
        """Make a mistake for as long as the block runs; the time of the file has it compiled anew."""
        path = self.folder / "fenics_contact" / mutation.file
        right, known = path.read_text(encoding="utf-8"), path.stat()
        path.write_text(replaced(mutation, right), encoding="utf-8")
        try:
            yield
        finally:
            path.write_text(right, encoding="utf-8")
            os.utime(path, ns=(known.st_atime_ns, known.st_mtime_ns))

    def run(self, tests: Sequence[str]) -> Run:
        """Run tests until one fails. The exit status tells a failed test from tests that were not found."""
        command = [sys.executable, "-m", "pytest", "-x", "-q", "-p", "no:cacheprovider", *tests]
        end = subprocess.run(
            command, cwd=self.folder, env=self.environment, capture_output=True, text=True, timeout=TIMEOUT
        )
        return Run(end.returncode, f"{end.stdout}\n{end.stderr}"[-4000:])

    def place_of_package(self) -> Path:
        """Return where a process that uses the copy finds the package."""
        command = [sys.executable, "-c", "import fenics_contact; print(fenics_contact.__file__)"]
        end = subprocess.run(
            command, cwd=self.folder, env=self.environment, capture_output=True, text=True, check=True
        )
        return Path(end.stdout.strip())


def replaced(mutation: Mutation, right: str) -> str:
    """Return a file's text with the mistake.

    Raises:
        LookupError: If the text to replace does not occur exactly once: the mutation must follow the code.
    """
    count = right.count(mutation.text)
    if count != 1:
        raise LookupError(
            f"the mutation {mutation.mistake!r} needs its text once in {mutation.file}, found it {count} "
            f"times: take over how the code says it now, it was {mutation.text!r}"
        )
    return right.replace(mutation.text, mutation.by)
