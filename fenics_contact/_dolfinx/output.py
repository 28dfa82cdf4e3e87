"""Files of fields."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path

from fenics_contact._dolfinx.loading import dolfinx


def write_xdmf(path: Path, mesh: dolfinx.mesh.Mesh, functions: Sequence[dolfinx.fem.Function]) -> None:
    """Write fields on one mesh to an XDMF file (with its HDF5 file). Collective on the mesh."""
    with dolfinx.io.XDMFFile(mesh.comm, str(path), "w") as file:
        file.write_mesh(mesh)
        for function in functions:
            file.write_function(function)
