"""The scenes that can be studied by name."""

from __future__ import annotations

import importlib
from pathlib import Path

from fenics_contact._base.checks import run_file
from fenics_contact.errors import InvalidInputError
from fenics_contact.study.study import StudyScene

#: Names of the built-in studies.
BUILT_IN = ("hertz", "cattaneo_mindlin", "chain_links")


def find_study(name: str) -> StudyScene:
    """Return the built-in study of a name, or the one that a Python file defines as ``study``."""
    if name.endswith(".py"):
        return _checked(getattr(run_file(Path(name)), "study", None), name)
    if name not in BUILT_IN:
        raise InvalidInputError(
            f"a study is one of {list(BUILT_IN)} or a Python file that defines `study`, got {name!r}"
        )
    module = importlib.import_module(f"{__name__}.{name}")
    return _checked(getattr(module, "study", None), name)


def scene_file(name: str) -> Path | None:
    """Return the file that defines a study of the user's own, None for a built-in one."""
    return Path(name) if name.endswith(".py") else None


def _checked(study: object, name: str) -> StudyScene:
    if not isinstance(study, StudyScene):
        raise InvalidInputError(
            f"{name!r} must define `study`, a StudyScene, got {type(study).__name__}: see study/scenes"
        )
    return study
