"""Files of fields."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path

from fenics_contact._dolfinx.loading import dolfinx, old


def has_vtx() -> bool:
    """Return whether this dolfinx was built with ADIOS2."""
    return hasattr(dolfinx.io, "VTXWriter")


def write_xdmf(path: Path, mesh: dolfinx.mesh.Mesh, functions: Sequence[dolfinx.fem.Function]) -> None:
    """Write fields on one mesh to an XDMF file (with its HDF5 file). Collective on the mesh."""
    with dolfinx.io.XDMFFile(mesh.comm, str(path), "w") as file:
        file.write_mesh(mesh)
        for function in functions:
            file.write_function(function)


def write_vtx(path: Path, function: dolfinx.fem.Function, value: float, *, cellwise: bool) -> None:
    """Write a field to a folder in the VTX format of ADIOS2, as its one step. Collective on its mesh.

    Args:
        path: The folder.
        function: The field.
        value: Time of the step.
        cellwise: Whether the field is constant on cells; it is written as a discontinuous linear one, the
            lowest degree that every version of dolfinx writes.
    """
    mesh = function.function_space.mesh
    options = {} if old() else {"engine": "BP4"}
    fields = [_discontinuous(function) if cellwise else function]
    with dolfinx.io.VTXWriter(mesh.comm, str(path), fields, **options) as file:
        file.write(value)


def _discontinuous(function: dolfinx.fem.Function) -> dolfinx.fem.Function:
    make = dolfinx.fem.FunctionSpace if old() else dolfinx.fem.functionspace
    space = make(function.function_space.mesh, ("Discontinuous Lagrange", 1))
    finer = dolfinx.fem.Function(space, name=function.name)
    finer.interpolate(function)
    return finer
