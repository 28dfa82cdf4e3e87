"""Changes of volume: the determinant of the deformation gradient in the cells of a mesh."""

from __future__ import annotations

from functools import cached_property

import numpy as np

from fenics_contact import _dolfinx
from fenics_contact.fem.cell_polynomials import CellPolynomials
from fenics_contact.fem.templates import quadrature_degree
from fenics_contact.mesh import CELL_TYPES, jacobians, quadrature


class Dilatation:
    """det F at the Gauss points of one mesh."""

    def __init__(self, space: _dolfinx.fem.FunctionSpace, cell_type: str, points: np.ndarray) -> None:
        """Evaluate the Jacobians of the undeformed cells.

        Args:
            space: Displacements on the mesh.
            cell_type: Of the mesh.
            points: Coordinates by block, shape (n, dim), [length].
        """
        self._positions, _ = quadrature(CELL_TYPES[cell_type], quadrature_degree(cell_type))
        self._points, self._cells = points, _dolfinx.vtk_cell_dofs(space)
        self._undeformed = jacobians(points, self._cells, self._positions)
        self._cell_type = cell_type

    @cached_property
    def polynomials(self) -> CellPolynomials:
        """The polynomials of the undeformed cells."""
        return CellPolynomials(self._points, self._cells, self._cell_type)

    def least(self, displacement: np.ndarray) -> float:
        """Return the smallest det F of all Gauss points.

        Args:
            displacement: By dof, shape (dim n,), [length].
        """
        return float(self.at(displacement).min())

    def at(self, displacement: np.ndarray) -> np.ndarray:
        """Return det F, shape (n_cells, n_gauss), of linear simplices (n_cells, 1)."""
        moved = self._points + displacement.reshape(self._points.shape)
        return np.asarray(jacobians(moved, self._cells, self._positions) / self._undeformed)
