"""A result can say what it was computed with."""

from __future__ import annotations

import signal
from importlib import metadata
from pathlib import Path

import numpy as np
import pytest

from fenics_contact import _dolfinx
from fenics_contact.output import result as provenance
from fenics_contact.output import versions, write_json


def test_versions_name_everything_that_computed(tmp_path: object) -> None:
    found = versions()
    assert set(found) >= {
        "python", "numpy", "scipy", "dolfinx", "petsc", "mpi", "gmsh", "pyvista", "fenics_contact"
    }  # fmt: skip
    assert found["numpy"] == np.__version__
    assert found["dolfinx"] == _dolfinx.release()
    assert found["petsc"].startswith("3.")
    assert "MPI" in found["mpi"]
    write_json(f"{tmp_path}/versions.json", found)


def test_a_library_that_is_not_there_is_said_to_be_missing(monkeypatch: pytest.MonkeyPatch) -> None:
    def nothing(name: str) -> str:
        raise metadata.PackageNotFoundError(name)

    monkeypatch.setattr(metadata, "version", nothing)
    found = versions()
    assert found["numpy"] == np.__version__, "where there are no metadata the library itself is asked"
    monkeypatch.setattr(provenance, "_MODULES", ("no_such_library",))
    assert versions()["no_such_library"] == "not installed"


def test_a_library_that_takes_ctrl_c_at_its_import_gives_it_back(
    monkeypatch: pytest.MonkeyPatch, tmp_path: Path
) -> None:
    """As gmsh does, which Debian installs without metadata."""
    (tmp_path / "takes_it.py").write_text(
        "import signal\n__version__ = '4.8'\nsignal.signal(signal.SIGINT, signal.SIG_DFL)\n"
    )
    monkeypatch.syspath_prepend(tmp_path)
    monkeypatch.setattr(provenance, "_MODULES", ("takes_it",))
    before = signal.signal(signal.SIGINT, signal.default_int_handler)
    try:
        assert versions()["takes_it"] == "4.8"
        assert signal.getsignal(signal.SIGINT) is signal.default_int_handler
    finally:
        signal.signal(signal.SIGINT, before)
