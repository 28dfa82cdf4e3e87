"""The public names, and the texts that users read and run."""

from __future__ import annotations

import inspect
import re
from pathlib import Path
from types import ModuleType
from typing import Any

import fenics_contact
from tests.conftest import ROOT

#: What users read and run.
FOLDERS = (
    "demos/*.py",
    "demos/scenes/*.toml",
    "notebooks/*.py",
    "docs/*.md",
    "docs/guide/*.md",
    "docs/studies/true_surfaces.md",
    "README.md",
)


def texts() -> dict[Path, str]:
    return {path: path.read_text() for pattern in FOLDERS for path in sorted(ROOT.glob(pattern))}


def code_of(path: Path, text: str) -> str:
    """Return a script as it is, and of a page what is set as code: fences and words between backticks."""
    if path.suffix != ".md":
        return text
    return "\n".join(re.findall(r"^```.*?^```|`[^`\n]+`", text, re.DOTALL | re.MULTILINE))


def rooms() -> list[ModuleType]:
    values = (getattr(fenics_contact, name) for name in fenics_contact.__all__)
    return [value for value in values if inspect.ismodule(value)]


def public() -> dict[str, Any]:
    """Return every public name, with its room, and what it stands for."""
    found = {name: getattr(fenics_contact, name) for name in fenics_contact.__all__ if name[0] != "_"}
    for room in rooms():
        found |= {f"{room.__name__.rpartition('.')[2]}.{name}": getattr(room, name) for name in room.__all__}
    return found
