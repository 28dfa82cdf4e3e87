"""Importing FEniCSx through the package leaves the process as it was."""

from __future__ import annotations

import sys
import textwrap
from collections.abc import Callable
from pathlib import Path

import pytest

from fenics_contact import clean_environment
from fenics_contact._base.launching import finished
from tests.conftest import ROOT

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


COMPILED = """
    import logging, os, sys
    logging.basicConfig(level=logging.WARNING, stream=sys.stdout)
    import numpy as np
    import ufl
    from mpi4py import MPI
    from fenics_contact import _dolfinx
    for k in (1, 2):  # the first of them imports dolfinx
        one = ufl.Constant(_dolfinx.template("triangle"))
        _dolfinx.CompiledForm(MPI.COMM_SELF, one**k * ufl.dx(domain=_dolfinx.template("triangle")))
    corners = np.array([[0.0, 0.0], [1.0, 0.0], [0.0, 1.0]])
    _dolfinx.coefficient(_dolfinx.local_mesh(corners, np.array([[0, 1, 2]]), "triangle"), "u")
    assert "PLAT" not in os.environ, "of setuptools"
    logging.warning("said")
"""


def test_the_commands_of_the_compiler_are_not_logged(
    mpirun: Callable[..., str], monkeypatch: pytest.MonkeyPatch, tmp_path: Path
) -> None:
    monkeypatch.setenv("XDG_CACHE_HOME", str(tmp_path))
    assert mpirun(COMPILED, 1, fresh=True).strip() == "WARNING:root:said"
    assert list(tmp_path.rglob("*.so")), "nothing was compiled"


def test_what_the_compiler_says_is_shown_if_it_fails(tmp_path: Path) -> None:
    script = tmp_path / "script.py"
    script.write_text(textwrap.dedent(COMPILED))
    environment = {**clean_environment(), "XDG_CACHE_HOME": str(tmp_path), "CC": str(tmp_path / "broken")}
    environment["PYTHONPATH"] = str(ROOT)
    (tmp_path / "broken").write_text("#!/bin/sh\necho the disk is full >&2\nexit 1\n")
    (tmp_path / "broken").chmod(0o755)
    answer = finished([sys.executable, str(script)], 120.0, environment=environment)
    assert answer.status == 1
    assert "the disk is full" in answer.errors


@pytest.mark.parametrize("own", [False, True])
def test_loader_logging_and_warnings_are_as_before(mpirun: Callable[..., str], own: bool) -> None:
    assert mpirun(CODE.replace("{own}", str(own)), 1, fresh=True) == "untouched"
