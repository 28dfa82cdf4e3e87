"""Names from a Python file of the user's own: "file.py:Name"."""

from __future__ import annotations

import importlib.util
import sys
from pathlib import Path
from typing import Any

from fenics_contact.checks import require_file
from fenics_contact.errors import InvalidInputError, scene_file_code

_NOTHING = object()


def is_reference(text: object) -> bool:
    """Return whether a text has the form "file.py:Name"."""
    file, colon, name = text.rpartition(":") if isinstance(text, str) else ("", "", "")
    return bool(colon) and file.endswith(".py") and name.isidentifier()


def load(reference: str, folder: Path) -> Any:
    """Return the object of a name in a Python file; the file is run.

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
    sys.modules[module_name] = module  # dataclasses of the file are looked up there
    with scene_file_code(f"the Python file '{path}'"):
        spec.loader.exec_module(module)
        loaded = getattr(module, name, _NOTHING)
    if loaded is _NOTHING:
        known = sorted(
            key for key, value in vars(module).items() if getattr(value, "__module__", "") == module_name
        )
        raise InvalidInputError(f"'{path}' must define {name!r}, it defines {known}: use one of them")
    return loaded
