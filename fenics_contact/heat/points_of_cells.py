"""Points in cells: where they are, and the functions of nodes there."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from fenics_contact._kinematics.measure import Measure
from fenics_contact.mesh.body_mesh import BodyMesh
from fenics_contact.mesh.cell_types import CellType, shape_gradients, shape_values
from fenics_contact.mesh.collapsed import as_hexahedra, places_of


@dataclass(frozen=True, eq=False)
class PointsOfCells:
    """The same points in some cells of a mesh.

    `nodes`: of the cells, (n, m); `shape`: functions of nodes, (n_points, m'); `slopes`: their gradients, (n,
    n_points, m', dim); `places`: (n, n_points, dim); `volumes`: of the cells over the reference cell, (n,
    n_points).
    """

    nodes: np.ndarray
    shape: np.ndarray
    slopes: np.ndarray
    places: np.ndarray
    volumes: np.ndarray

    @classmethod
    def of(cls, mesh: BodyMesh, cells: np.ndarray, cell: CellType, positions: np.ndarray) -> PointsOfCells:
        """Return those at positions in a reference cell, (n_points, dim), in cells, (n,)."""
        shape, slopes, nodes = (
            shape_values(cell, positions),
            shape_gradients(cell, positions),
            mesh.cells[cells],
        )
        at = places_of(mesh.points, nodes)
        jacobian = np.einsum("cai,qaj->cqij", at, slopes)
        slopes, volumes = slopes @ np.linalg.inv(jacobian), np.abs(np.linalg.det(jacobian))
        return cls(nodes, shape, slopes, np.einsum("qa,cai->cqi", shape, at), volumes)

    def sizes(self, weights: np.ndarray, measure: Measure) -> np.ndarray:
        """Return what belongs to points by the weights of a quadrature, (n_points,), shape (n, n_points)."""
        return np.asarray(weights * self.volumes * measure.around(self.places[..., 0]))

    def of_nodes(self, values: np.ndarray) -> np.ndarray:
        """Return values at the nodes of the cells, (n, m, ...), as at those of whole hexahedra."""
        return as_hexahedra(values, self.nodes, self.places.shape[-1])
