"""Internal forces of linear bodies beside nonlinear ones."""

from __future__ import annotations

import numpy as np
import scipy.sparse as sp

from fenics_contact import _dolfinx
from fenics_contact.fem.mechanics import Response


class LinearMechanics:
    """`Mechanics` of linear materials alone: small strains, whatever the displacement."""

    def __init__(self, stiffness: _dolfinx.fem.Form, mesh: _dolfinx.mesh.Mesh, points: np.ndarray) -> None:
        """Assemble.

        Args:
            stiffness: The bilinear form, bound to the mesh.
            mesh: The mesh.
            points: Coordinates by input node, shape (n, dim), [length].
        """
        _dolfinx.update_coordinates(mesh, points)
        indptr, indices, data = _dolfinx.assemble_csr(stiffness)
        self._stiffness = sp.csr_matrix((data, indices, indptr), shape=(points.size,) * 2)

    def at(
        self,
        displacement: np.ndarray,
        history: np.ndarray | None = None,
        duration: float = np.nan,
        origin: np.ndarray | None = None,
    ) -> Response:
        """Return K u and K; see `Mechanics.at`."""
        force = self._stiffness @ displacement
        return Response(force, lambda: self._stiffness, float(force @ displacement) / 2, 1.0)

    def least_jacobian(self, displacement: np.ndarray) -> float:
        """Return 1: in small strain no volume changes."""
        return 1.0
