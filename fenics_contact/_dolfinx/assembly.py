"""Assembly of bound forms."""

from __future__ import annotations

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
