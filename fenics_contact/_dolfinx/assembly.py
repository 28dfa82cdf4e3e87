"""Assembly of bound forms, and files of fields."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path

import numpy as np

from fenics_contact._base.libraries import PETSc
from fenics_contact._dolfinx.loading import dolfinx


def assemble_csr(form: dolfinx.fem.Form) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Assemble a bilinear form on one rank; return the matrix as CSR arrays (indptr, indices, data)."""
    matrix = assemble_matrix(form)
    indptr, indices, data = matrix.getValuesCSR()
    matrix.destroy()
    return indptr, indices, data


def assemble_matrix(form: dolfinx.fem.Form) -> PETSc.Mat:
    """Assemble a bilinear form on a distributed mesh into a PETSc matrix. Collective on the mesh."""
    matrix = dolfinx.fem.petsc.assemble_matrix(form)
    matrix.assemble()
    return matrix


def assemble_vector(form: dolfinx.fem.Form) -> np.ndarray:
    """Assemble a linear form on one rank; return its values, length block size x n_dofs."""
    vector = dolfinx.fem.petsc.assemble_vector(form)
    values = np.array(vector.array_r)
    vector.destroy()
    return values


def assemble_scalar(form: dolfinx.fem.Form) -> float:
    """Assemble a functional on this rank's cells (no communication)."""
    return float(dolfinx.fem.assemble_scalar(form))


def write_xdmf(path: Path, mesh: dolfinx.mesh.Mesh, functions: Sequence[dolfinx.fem.Function]) -> None:
    """Write fields on one mesh to an XDMF file (with its HDF5 file). Collective on the mesh."""
    with dolfinx.io.XDMFFile(mesh.comm, str(path), "w") as file:
        file.write_mesh(mesh)
        for function in functions:
            file.write_function(function)
