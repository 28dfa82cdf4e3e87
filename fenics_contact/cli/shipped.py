"""Location of the demos and example scenes: beside the package in a checkout, inside it if installed."""

from __future__ import annotations

import ast
import re
from dataclasses import dataclass
from pathlib import Path

from fenics_contact.errors import InvalidInputError


@dataclass(frozen=True)
class Shipped:
    """A demo or an example scene.

    Attributes:
        name: Its name.
        path: Its file.
        title: Its first line of text, up to the first full stop.
    """

    name: str
    path: Path
    title: str

    @property
    def is_scene(self) -> bool:
        """Whether it is a scene file."""
        return self.path.suffix == ".toml"


def folder_of_demos() -> Path:
    """Return the folder of the demos.

    Raises:
        InvalidInputError: If there is none beside this package.
    """
    package = Path(__file__).resolve().parents[1]
    for folder in (package.parent / "demos", package / "demos"):
        if any(folder.glob("demo_*.py")):
            return folder
    raise InvalidInputError(
        f"demos must lie in 'demos' in or beside {package}, there are none: install the package again"
    )


def shipped() -> dict[str, Shipped]:
    """Return all demos and example scenes by name; names of scenes include the suffix."""
    folder = folder_of_demos()
    demos = [
        Shipped(path.stem.removeprefix("demo_"), path, _title(path))
        for path in sorted(folder.glob("demo_*.py"))
    ]
    scenes = [Shipped(path.name, path, _title(path)) for path in sorted(folder.glob("scenes/*.toml"))]
    return {one.name: one for one in (*demos, *scenes)}


def _title(path: Path) -> str:
    lines = path.read_text(encoding="utf-8").splitlines()
    words = [line.lstrip("# ").rstrip() for line in lines[:5] if line.startswith("# ")]
    return re.split(r"[.;](?: |$)", words[0])[0] if words else ""


def optimises(path: Path) -> bool:
    """Return whether a scene file describes an optimisation."""
    return bool(re.search(r"^\[\[?design", path.read_text(encoding="utf-8"), re.MULTILINE))


def takes(path: Path) -> list[str]:
    """Return the options that a demo accepts."""
    tree = ast.parse(path.read_text(encoding="utf-8"))
    constants = (node.value for node in ast.walk(tree) if isinstance(node, ast.Constant))
    return sorted(
        {value for value in constants if isinstance(value, str) and re.fullmatch(r"--[a-z-]+", value)}
    )
