"""Lazy import of dolfinx without its side effects; nothing else imports it."""

from __future__ import annotations

import logging
import sys
import warnings
from collections.abc import Iterator
from contextlib import contextmanager
from functools import cache
from typing import Any

from fenics_contact._libraries import Late
from fenics_contact._requirements import DOLFINX, load_petsc


@contextmanager
def side_effects_undone() -> Iterator[None]:
    """Undo the side effects of importing and compiling with old releases.

    dolfinx 0.5 switches `sys.setdlopenflags` to RTLD_GLOBAL for good, after which VTK's own
    libraries clash with the system's; ffcx 0.5 configures the root logger and captures warnings.
    """
    root = logging.getLogger()
    handlers, level, setdlopenflags = list(root.handlers), root.level, sys.setdlopenflags
    showwarning = warnings.showwarning
    sys.setdlopenflags = lambda flags: None
    try:
        yield
    finally:
        sys.setdlopenflags = setdlopenflags
        root.handlers[:] = handlers
        root.setLevel(level)
        if warnings.showwarning is not showwarning:
            logging.captureWarnings(False)


def _load() -> Any:
    """Import dolfinx with the submodules that are used."""
    load_petsc()  # names what is wrong with it; dolfinx would fail in its own words
    with side_effects_undone():
        import dolfinx
        import dolfinx.fem
        import dolfinx.fem.petsc
        import dolfinx.io
        import dolfinx.mesh
    return dolfinx


dolfinx: Any = Late("dolfinx", _load)
fem: Any = Late("dolfinx.fem", lambda: dolfinx.fem)
cpp: Any = Late("dolfinx.cpp", lambda: dolfinx.cpp)
jit: Any = Late("dolfinx.jit", lambda: dolfinx.jit)


def release() -> str:
    """Return the full version of dolfinx."""
    return str(dolfinx.__version__)


@cache
def version() -> tuple[int, ...]:
    """Return the first two numbers of dolfinx's version."""
    return tuple(int(part) for part in (DOLFINX.version() or dolfinx.__version__).split(".")[:2])


def old() -> bool:
    """Return whether dolfinx has the interface of 0.5 and 0.6; later releases have the newer one."""
    return version() < (0, 7)
