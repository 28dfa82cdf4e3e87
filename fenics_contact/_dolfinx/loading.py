"""Importing dolfinx without its side effects; nothing else imports it first."""

from __future__ import annotations

import logging
import sys
import warnings
from collections.abc import Iterator
from contextlib import contextmanager


@contextmanager
def side_effects_undone() -> Iterator[None]:
    """Undo what importing and compiling with old releases leaves behind in the process.

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


with side_effects_undone():
    import dolfinx
    import dolfinx.fem
    import dolfinx.fem.petsc
    import dolfinx.io
    import dolfinx.mesh
    from dolfinx import cpp, jit

__all__ = ["OLD", "RELEASE", "VERSION", "cpp", "dolfinx", "jit", "side_effects_undone"]

RELEASE: str = dolfinx.__version__
VERSION: tuple[int, ...] = tuple(int(part) for part in RELEASE.split(".")[:2])
#: The interface of dolfinx 0.5 and 0.6; later releases have the newer one.
OLD = VERSION < (0, 7)
