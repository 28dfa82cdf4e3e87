"""Provenance of results."""

from __future__ import annotations

import importlib
import platform
from importlib import metadata
from types import ModuleType

from fenics_contact import _dolfinx
from fenics_contact._libraries import MPI, PETSc

_MODULES = ("numpy", "scipy", "mpi4py", "petsc4py", "gmsh", "clarabel", "pyvista", "vtk")


def versions() -> dict[str, str]:
    """Return the versions of Python, of the libraries that computed and of this package, by name.

    A library that is not installed or does not report its version is marked as such.
    """
    entries = {"fenics_contact": _installed("fenics_contact"), "python": platform.python_version()}
    entries["dolfinx"] = _dolfinx.release()
    entries["petsc"] = ".".join(map(str, PETSc.Sys.getVersion()))
    entries["mpi"] = MPI.Get_library_version().partition(",")[0].strip("\x00 \n")
    return entries | {name: _installed(name) for name in _MODULES}


def _installed(name: str) -> str:
    """Return the version from the metadata or, without these, from the library itself."""
    try:
        return metadata.version(name)
    except metadata.PackageNotFoundError:
        pass
    try:
        module: ModuleType = importlib.import_module(name)
    except ImportError:
        return "not installed"
    return str(getattr(module, "__version__", "unknown"))
