"""Importing FEniCSx through the package leaves the process as it was."""

from __future__ import annotations

from collections.abc import Callable

import pytest

CODE = """
    import logging, sys, warnings

    if {own}:  # what the user has set up must stay; where there is nothing, nothing must be added
        logging.captureWarnings(True)
        logging.getLogger().addHandler(logging.NullHandler())
        logging.getLogger().setLevel(logging.ERROR)

    def habits():
        root = logging.getLogger()
        return sys.getdlopenflags(), list(root.handlers), root.level, warnings.showwarning, sys.setdlopenflags

    before = habits()
    from fenics_contact import _dolfinx
    assert habits() == before, "importing"

    import ufl
    from mpi4py import MPI
    one = ufl.Constant(_dolfinx.template("tetrahedron"))
    _dolfinx.CompiledForm(MPI.COMM_SELF, one * ufl.dx(domain=_dolfinx.template("tetrahedron")))
    assert habits() == before, "compiling"
    sys.stdout.write("untouched")
"""


@pytest.mark.parametrize("own", [False, True])
def test_loader_logging_and_warnings_are_as_before(mpirun: Callable[..., str], own: bool) -> None:
    assert mpirun(CODE.replace("{own}", str(own)), 1) == "untouched"
