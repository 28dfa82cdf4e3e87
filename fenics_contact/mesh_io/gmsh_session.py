"""A separate gmsh model that leaves the caller's gmsh, terminal and signal handlers unchanged."""

from __future__ import annotations

import ctypes
import importlib
import inspect
import os
import signal
import sys
import threading
from collections.abc import Iterator
from contextlib import contextmanager
from types import ModuleType

from fenics_contact._requirements import check_gmsh
from fenics_contact.progress import Task

_OPTIONS = {
    "General.Terminal": 0.0,
    "Geometry.AutoCoherence": 1.0,
    "Geometry.Tolerance": 1e-8,
    "Mesh.ElementOrder": 1.0,
    "Mesh.MeshOnlyVisible": 0.0,
    "Mesh.SubdivisionAlgorithm": 0.0,
}
"""Options on which the meshes of this package rely: gmsh's defaults, without output."""


@contextmanager
def gmsh_model(name: str, **more: float) -> Iterator[ModuleType]:
    """Open an empty gmsh model and remove it afterwards.

    If gmsh is already initialised the caller's models, current model and options are restored; if not, it is
    initialised without configuration files and finalised.

    Args:
        name: Name of the model.
        **more: Further options of gmsh by their names, such as ``{"Mesh.MeshSizeMax": 2.0}``.

    Yields:
        The module ``gmsh`` with the new model current.

    Raises:
        MissingRequirementError: If gmsh is missing, too old or cannot be loaded.
    """
    with Task("mesh"), _interrupt_handler_kept():
        gmsh = _import_gmsh()
        foreign = _is_initialised(gmsh)
        if not foreign:
            _initialise(gmsh)
        wanted = {**_OPTIONS, **more}
        options = {option: gmsh.option.getNumber(option) for option in wanted}
        current = gmsh.model.getCurrent()
        while name in gmsh.model.list():
            name += "'"
        try:
            for option, value in wanted.items():
                gmsh.option.setNumber(option, value)
            gmsh.model.add(name)
            yield gmsh
        finally:
            gmsh.model.setCurrent(name)
            gmsh.model.remove()
            gmsh.model.setCurrent(current)
            for option, value in options.items():
                gmsh.option.setNumber(option, value)
            if not foreign:
                gmsh.finalize()


def running_gmsh() -> ModuleType | None:
    """Return the module ``gmsh`` if it is initialised, else None.

    Raises:
        MissingRequirementError: If gmsh is missing, too old or cannot be loaded.
    """
    with _interrupt_handler_kept():
        gmsh = _import_gmsh()
        return gmsh if _is_initialised(gmsh) else None


def _initialise(gmsh: ModuleType) -> None:
    known = inspect.signature(gmsh.initialize).parameters
    gmsh.initialize(readConfigFiles=False, **({"interruptible": False} if "interruptible" in known else {}))


def _import_gmsh() -> ModuleType:
    check_gmsh()
    return importlib.import_module("gmsh")


@contextmanager
def _interrupt_handler_kept() -> Iterator[None]:
    """Restore the handler of SIGINT.

    gmsh replaces it at import, at initialisation or at finalisation, depending on the version.
    """
    handler = signal.getsignal(signal.SIGINT)
    try:
        yield
    finally:
        main = threading.current_thread() is threading.main_thread()
        if main and handler is not None and signal.getsignal(signal.SIGINT) is not handler:
            signal.signal(signal.SIGINT, handler)


def _is_initialised(gmsh: ModuleType) -> bool:
    if hasattr(gmsh, "isInitialized"):
        return bool(gmsh.isInitialized())
    # Older versions have no query: a call fails once gmsh is finalised, with a message on the terminal.
    with silenced(2):
        try:
            return len(gmsh.model.list()) > 0
        except Exception:
            return False


@contextmanager
def silenced(descriptor: int) -> Iterator[None]:
    """Discard what libraries write to standard output, 1, or to standard error, 2.

    OpenCASCADE prints a page of statistics for every STEP file.
    """
    (sys.stdout if descriptor == 1 else sys.stderr).flush()
    duplicate = os.dup(descriptor)
    sink = os.open(os.devnull, os.O_WRONLY)
    try:
        os.dup2(sink, descriptor)
        yield
    finally:
        ctypes.CDLL(None).fflush(None)  # what C still keeps would be written later
        os.dup2(duplicate, descriptor)
        os.close(sink)
        os.close(duplicate)
