"""Normals of mortar points: those of the slave, at its corners and edges those of the master.

Without friction, a corner is pressed along the normal of the smooth surface that it touches. The mean normal
of the facets around a corner depends on which of them the surface has, and leans as the body does. There the
normal is n = N / ‖N‖ with N = Σ_j W_j m_j, the normals m_j of the master's nodes weighted like its
displacements: where faces lie on each other this is minus the normal of the slave's face.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
import scipy.sparse as sp

from fenics_contact._surfaces.facets import FacetedSurface


@dataclass(frozen=True)
class MasterNormals:
    """Points that have normals of the master.

    Attributes:
        point: Which they are, ascending, shape (n,).
        normal: Their unit normals, from master to slave, shape (n, dim).
        length: ‖N‖, shape (n,).
    """

    point: np.ndarray
    normal: np.ndarray
    length: np.ndarray

    @classmethod
    def of(
        cls, slave: FacetedSurface, master: FacetedSurface, node: np.ndarray, weight: sp.csr_matrix
    ) -> MasterNormals:
        """Find them among points at nodes of the slave, shape (n,), with weights (n, len(master.nodes))."""
        none = np.zeros(0, dtype=np.int64)
        point = none if slave.sharp is None else np.flatnonzero(slave.sharp[node])
        summed = slave.within(weight[point] @ master.normals, slave.mirrored[node[point]])
        length = np.linalg.norm(summed, axis=1)
        known = length > 0.0
        return cls(point[known], summed[known] / length[known, None], length[known])

    def across(self, slave: FacetedSurface, node: np.ndarray, vectors: np.ndarray) -> np.ndarray:
        """Return the derivatives by N of those by the normals, shape (n, dim)."""
        along = np.einsum("nd,nd->n", vectors, self.normal)[:, None]
        by_summed = (vectors - along * self.normal) / self.length[:, None]
        return slave.within(by_summed, slave.mirrored[node[self.point]])


def normals_at(
    slave: FacetedSurface, master: FacetedSurface, node: np.ndarray, weight: sp.csr_matrix
) -> np.ndarray:
    """Return the unit normals of points, from master to slave, shape (n, dim); arguments as before."""
    normal, of_master = -slave.normals[node], MasterNormals.of(slave, master, node, weight)
    normal[of_master.point] = of_master.normal
    return normal
