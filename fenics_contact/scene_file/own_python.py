"""Names from a Python file of the user's own: "file.py:Name"."""

from __future__ import annotations

import importlib.util
import sys
from collections.abc import Iterator
from pathlib import Path
from typing import TYPE_CHECKING, Any

from fenics_contact.checks import require_file
from fenics_contact.errors import InvalidInputError, running
from fenics_contact.scene_file.places import as_toml, written

if TYPE_CHECKING:
    from fenics_contact.scene_file.document import Document
    from fenics_contact.scene_file.mistakes import Mistake
    from fenics_contact.scene_file.places import Path as Keys
    from fenics_contact.scene_file.source import Source

_NOTHING = object()


def is_reference(text: object) -> bool:
    """Tell whether a text has the form "file.py:Name"."""
    file, colon, name = text.rpartition(":") if isinstance(text, str) else ("", "", "")
    return bool(colon) and file.endswith(".py") and name.isidentifier()


def load(reference: str, folder: Path) -> Any:
    """Return what a Python file calls by a name; the file is run.

    Args:
        reference: "file.py:Name".
        folder: Folder to which the file is relative.

    Raises:
        InvalidInputError: If there is no such file, it cannot be run or does not define the name.
    """
    file, _, name = reference.rpartition(":")
    path = folder / file
    require_file(path, "a Python file")
    module_name = f"_fenics_contact_scene_{path.stem}"
    spec = importlib.util.spec_from_file_location(module_name, path)
    assert spec is not None
    assert spec.loader is not None
    module = importlib.util.module_from_spec(spec)
    sys.modules[module_name] = module  # dataclasses of the file look themselves up there
    with running(f"the Python file '{path}'"):
        spec.loader.exec_module(module)
        found = getattr(module, name, _NOTHING)
    if found is _NOTHING:
        known = sorted(
            key for key, value in vars(module).items() if getattr(value, "__module__", "") == module_name
        )
        raise InvalidInputError(f"'{path}' must define {name!r}, it defines {known}: use one of them")
    return found


def references(document: Document) -> Iterator[tuple[Keys, str]]:
    """Yield what a scene file takes from Python files, with its keys: all of them are run."""
    for name, material in document.materials.items():
        if is_reference(material.model):
            yield ("materials", name, "model"), material.model
    if document.design is not None and is_reference(document.design.objective):
        yield ("design", "objective"), document.design.objective


def refused_python(source: Source, document: Document) -> list[Mistake]:
    """Return a mistake for everything that a scene file takes from a Python file."""
    return [
        source.mistake(
            path,
            f"{written(path)} must not be Python code (--no-python), got {as_toml(reference)}: read that "
            "file, and leave --no-python out if you trust it",
        )
        for path, reference in references(document)
    ]
