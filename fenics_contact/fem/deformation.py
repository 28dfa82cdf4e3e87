"""Changes of volume: the determinant of the deformation gradient in the cells of a mesh."""

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
        self._positions, self._weights = quadrature(CELL_TYPES[cell_type], quadrature_degree(cell_type))
        self._points, self._cells = points, _dolfinx.vtk_cell_dofs(space)
        self._undeformed = jacobians(points, self._cells, self._positions)

    @property
    def volumes(self) -> np.ndarray:
        """Volume of each undeformed cell, shape (n_cells,), [length^dim]."""
        return self._integral(self._undeformed)

    def least(self, displacement: np.ndarray) -> float:
        """Return the smallest det F of all Gauss points.

        Args:
            displacement: By dof, shape (dim n,), [length].
        """
        return float((self._deformed(displacement) / self._undeformed).min())

    def means(self, displacement: np.ndarray) -> np.ndarray:
        """Return the mean det F of each cell, its volume divided by the undeformed one, shape (n_cells,)."""
        return self._integral(self._deformed(displacement)) / self.volumes

    def _deformed(self, displacement: np.ndarray) -> np.ndarray:
        moved = self._points + displacement.reshape(self._points.shape)
        return jacobians(moved, self._cells, self._positions)

    def _integral(self, jacobian: np.ndarray) -> np.ndarray:
        # In a linear simplex there is one value for all points.
        return np.asarray(np.broadcast_to(jacobian, (len(jacobian), len(self._weights))) @ self._weights)
