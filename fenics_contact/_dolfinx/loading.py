"""Lazy import of dolfinx without its side effects; nothing else imports it."""

from __future__ import annotations

import logging
import os
import sys
import warnings
from collections.abc import Iterator
from contextlib import contextmanager
from functools import cache
from types import ModuleType
from typing import TYPE_CHECKING

from fenics_contact._base.form_language import without_setuptools
from fenics_contact._base.libraries import Late
from fenics_contact._base.requirements import load_dolfinx

__all__ = [
    "cpp",
    "dolfinx",
    "fem",
    "mesh",
    "old",
    "release",
    "side_effects_undone",
    "untested",
    "version",
    "warn_if_untested",
]

_log = logging.getLogger(__name__)


class _NoCommand(logging.Filter):
    """Drops what the root logger itself is told of commands."""

    def filter(self, record: logging.LogRecord) -> bool:
        """Return whether a record is a warning or worse."""
        return record.levelno >= logging.WARNING


@contextmanager
def side_effects_undone() -> Iterator[None]:
    """Undo the side effects of importing and compiling.

    dolfinx 0.5 switches `sys.setdlopenflags` to RTLD_GLOBAL for good, after which VTK's own
    libraries clash with the system's; ffcx 0.5 configures the root logger and captures warnings. setuptools
    lowers the root logger's level, has it log every command of the compiler, and adds PLAT to the
    environment; what the compiler itself says reaches the terminal.
    """
    root = logging.getLogger()
    handlers, level, setdlopenflags = list(root.handlers), root.level, sys.setdlopenflags
    showwarning, platform_named = warnings.showwarning, "PLAT" in os.environ
    sys.setdlopenflags = lambda flags: None
    no_command = _NoCommand()  # one of its own, as these blocks are nested
    root.addFilter(no_command)
    try:
        yield
    finally:
        root.removeFilter(no_command)
        sys.setdlopenflags = setdlopenflags
        root.handlers[:] = handlers
        root.setLevel(level)
        if not platform_named:
            os.environ.pop("PLAT", None)
        if warnings.showwarning is not showwarning:
            logging.captureWarnings(False)


def _load() -> ModuleType:
    """Import dolfinx with the submodules that are used."""
    with side_effects_undone(), without_setuptools():
        load_dolfinx()
        import dolfinx
        import dolfinx.fem
        import dolfinx.fem.petsc
        import dolfinx.io
        import dolfinx.mesh
    return dolfinx


# Annotations have the names of 0.9: dolfinx.fem.Form, dolfinx.mesh.MeshTags and the AbstractFiniteElement of
# ufl.finiteelement are called FormMetaClass, MeshTagsMetaClass and FiniteElementBase in 0.5.
if TYPE_CHECKING:
    import dolfinx
    import dolfinx.fem.petsc
    from dolfinx import cpp, fem, mesh
else:
    dolfinx = Late("dolfinx", _load)
    fem = Late("dolfinx.fem", lambda: dolfinx.fem)
    cpp = Late("dolfinx.cpp", lambda: dolfinx.cpp)
    mesh = Late("dolfinx.mesh", lambda: dolfinx.mesh)


def release() -> str:
    """Return the full version of dolfinx."""
    return str(dolfinx.__version__)


@cache
def version() -> tuple[int, ...]:
    """Return the first two numbers of dolfinx's version."""
    return tuple(int(part) for part in release().split(".")[:2])


def untested(tested: tuple[tuple[int, ...], ...] = ((0, 5), (0, 9), (0, 10), (0, 11))) -> str:
    """Return a warning if this version of dolfinx was never tested with the package, else nothing."""
    if version() in tested:
        return ""
    known = ", ".join(".".join(map(str, numbers)) for numbers in tested)
    return (
        f"dolfinx {release()} was never tested with fenics_contact, only {known} were: "
        "first compare a case you know"
    )


@cache
def warn_if_untested(rank: int) -> None:
    """Warn once, on the first rank, of a dolfinx that was never tested with the package."""
    if untested() and rank == 0:  # asking for the version loads dolfinx, which is collective
        _log.warning(untested())


def old() -> bool:
    """Return whether dolfinx has the interface of 0.5 and 0.6; later releases have the newer one."""
    return version() < (0, 7)
