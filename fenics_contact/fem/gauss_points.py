"""Displacement gradients at the Gauss points of a mesh, and the forces and stiffness of stresses there."""

from __future__ import annotations

from functools import cached_property

import numpy as np
import scipy.sparse as sp

from fenics_contact import _dolfinx
from fenics_contact.fem.cell_polynomials import UNSEEN, CellPolynomials
from fenics_contact.fem.mean_strain import MeanStrain, held_share
from fenics_contact.fem.templates import quadrature_degree
from fenics_contact.mesh import CELL_TYPES, determinants, quadrature, shape_gradients


class GaussPoints:
    """The Gauss points of one mesh: those of the package's forms on cells of this type."""

    def __init__(self, space: _dolfinx.fem.FunctionSpace, cell_type: str, points: np.ndarray) -> None:
        """Evaluate the gradients of the shape functions.

        Args:
            space: Displacements on the mesh.
            cell_type: Of the mesh.
            points: Coordinates by block, shape (n, dim), [length].
        """
        cell = CELL_TYPES[cell_type]
        positions, weights = quadrature(cell, quadrature_degree(cell_type))
        reference = shape_gradients(cell, positions)
        self._shape, self._cells = points.shape, _dolfinx.vtk_cell_dofs(space)
        self._points, self._cell_type = points, cell_type
        jacobian = np.einsum("cai,qaj->cqij", points[self._cells], reference)
        self._gradients = reference @ np.linalg.inv(jacobian)
        self._weights = weights * determinants(jacobian)

    @property
    def shape(self) -> tuple[int, int]:
        """Numbers of cells and of points in each."""
        return self._gradients.shape[0], self._gradients.shape[1]

    def gradient(self, displacement: np.ndarray) -> np.ndarray:
        """Return ∂u_i/∂X_j in three dimensions, zero out of the plane, shape (n_cells, n_gauss, 3, 3).

        Args:
            displacement: By dof, shape (dim n,), [length].
        """
        dim = self._shape[1]
        nodal = displacement.reshape(self._shape)[self._cells]
        gradient = np.zeros((*self.shape, 3, 3))
        gradient[..., :dim, :dim] = nodal.swapaxes(1, 2)[:, None] @ self._gradients
        return gradient

    def force(self, stress: np.ndarray, cells: np.ndarray) -> np.ndarray:
        """Return ∫ P : ∇v over some cells by dof, shape (dim n,), [force].

        Args:
            stress: P at their points, shape (n_cells, n_gauss, 3, 3), [force / length²].
            cells: Numbers of the cells.
        """
        dim = self._shape[1]
        weighted = self._weights[cells][..., None, None] * stress[..., :dim, :dim]
        nodal = (self._gradients[cells] @ weighted.swapaxes(2, 3)).sum(axis=1)
        return np.bincount(self._dofs[cells].ravel(), nodal.ravel(), minlength=int(np.prod(self._shape)))

    def mean_strain(self, cells: np.ndarray, moduli: np.ndarray) -> MeanStrain:
        """Return the means of changes of volume in some cells.

        Args:
            cells: Numbers of the cells.
            moduli: Of the material at rest, by Voigt components, shape (6, 6), [force / length²].
        """
        share = held_share(moduli) if self._cell_type in UNSEEN else 0.0
        return MeanStrain(self._gradients[cells], self._polynomials.of(cells), share)

    def stiffness(
        self, tangent: np.ndarray, cells: np.ndarray, means: MeanStrain | None = None
    ) -> np.ndarray:
        """Return ∫ ∇v : A : ∇u over some cells: entries of the matrix of `assembled`.

        Args:
            tangent: A at their points, shape (n_cells, n_gauss, 3, 3, 3, 3), [force / length²].
            cells: Numbers of the cells.
            means: Means of changes of volume in these cells, where A is the tangent by them.
        """
        dim, (_, m) = self._shape[1], self.shape
        G, weights = self._gradients[cells], self._weights[cells]
        A = weights[..., None, None, None, None] * tangent[..., :dim, :dim, :dim, :dim]
        half = A.reshape(len(cells), m, dim**3, dim) @ G.swapaxes(2, 3)
        half = half.reshape(len(cells), m, dim, dim, -1).swapaxes(2, 3).reshape(len(cells), m * dim, -1)
        left = G.swapaxes(1, 2).reshape(len(cells), -1, m * dim)
        blocks = (left @ half).reshape(len(cells), left.shape[1], dim, dim, left.shape[1])
        entries = blocks.swapaxes(3, 4).ravel()
        if means is not None:
            entries = entries + means.blocks(tangent).ravel()
        _, _, places = self._pattern
        return np.bincount(places[cells].ravel(), entries, minlength=self.entries)

    def assembled(self, entries: np.ndarray, others: sp.csr_matrix | None = None) -> sp.csr_matrix:
        """Return the matrix with entries from `stiffness`; its pattern is the same whatever is zero in it.

        Args:
            entries: Sums of `stiffness`.
            others: A matrix of the same mesh that is added.
        """
        indptr, indices, _ = self._pattern
        size = len(indptr) - 1
        if others is not None:
            rows = np.repeat(np.arange(size), np.diff(others.indptr))
            own = np.repeat(np.arange(size), np.diff(indptr)) * size + indices
            entries = entries.copy()
            entries[np.searchsorted(own, rows * size + others.indices)] += others.data
        return sp.csr_matrix((entries, indices, indptr), shape=(size, size))

    @property
    def entries(self) -> int:
        """Number of entries of the matrix."""
        return len(self._pattern[1])

    @cached_property
    def _polynomials(self) -> CellPolynomials:
        """Those on which changes of volume are projected."""
        return CellPolynomials(self._points, self._cells, self._cell_type)

    @cached_property
    def _dofs(self) -> np.ndarray:
        """Dofs of each cell, shape (n_cells, dim nodes of a cell)."""
        dim = self._shape[1]
        return np.asarray((dim * self._cells[..., None] + np.arange(dim)).reshape(len(self._cells), -1))

    @cached_property
    def _pattern(self) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
        """Row starts and columns of the matrix, and for each cell where its entries belong."""
        size, dofs = int(np.prod(self._shape)), self._dofs.astype(np.int64)
        keys, places = np.unique(dofs[:, :, None] * size + dofs[:, None, :], return_inverse=True)
        indptr = np.searchsorted(keys, np.arange(size + 1) * size)
        return indptr, keys % size, places.reshape(len(dofs), -1)
