"""How much cells are compressed: the determinant of the deformation gradient at their Gauss points."""

from __future__ import annotations

import numpy as np

from fenics_contact import _dolfinx
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
        self._positions = quadrature(CELL_TYPES[cell_type], quadrature_degree(cell_type))[0]
        self._points, self._cells = points, _dolfinx.vtk_cell_dofs(space)
        self._undeformed = jacobians(points, self._cells, self._positions)

    def at(self, displacement: np.ndarray) -> np.ndarray:
        """Return det F, shape (n_cells, n_gauss).

        Args:
            displacement: By dof, shape (dim n,), [length].
        """
        moved = self._points + displacement.reshape(self._points.shape)
        return np.asarray(jacobians(moved, self._cells, self._positions) / self._undeformed)
