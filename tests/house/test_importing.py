"""Importing the package starts nothing."""

from __future__ import annotations

from collections.abc import Callable

IMPORT_ALL = """
    import importlib, os, pkgutil, subprocess, sys

    def environment():
        return os.environ.copy(), subprocess.run(["env", "-0"], capture_output=True).stdout

    before, flags = environment(), sys.getdlopenflags()
    import fenics_contact
    names = [found.name for found in pkgutil.walk_packages(fenics_contact.__path__, "fenics_contact.")]
    for name in names:
        if ".demos." not in name:
            importlib.import_module(name)
"""


def test_importing_every_module_starts_nothing(mpirun: Callable[..., str]) -> None:
    script = f"""{IMPORT_ALL}
    started = {{"mpi4py.MPI", "petsc4py.PETSc", "dolfinx"}} & set(sys.modules)
    assert not started, started
    assert environment() == before
    assert sys.getdlopenflags() == flags
    import mpi4py
    mpi4py.rc.initialize = False
    from mpi4py import MPI
    assert not MPI.Is_initialized()
    sys.stdout.write(f"{{len(names)}} {{'fenics_contact.feti.factor' in sys.modules}}")
    """
    count, deep = mpirun(script, 1, fresh=True).split()
    assert int(count) > 200
    assert deep == "True"
