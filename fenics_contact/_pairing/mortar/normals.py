"""Normals of mortar points: those of the slave, at its corners and edges those of the master.

Without friction, a corner is pressed along the normal of the smooth surface that it touches. The mean normal
of the facets around a corner depends on which of them the surface has, and leans as the body does. There the
normal is n = N / ‖N‖ with N = β Σ_j W_j m_j − (1 − β) n_s, the normals m_j of the master's nodes weighted
like its displacements: where faces lie on each other this is minus the normal n_s of the slave's face.

Where hardly any of a node's area D faces the master, weights are extrapolated from there, and their mean
normal turns without bound. So β = t²(3 − 2t), t = min(1, D / A), with an area A of the node of which much
less than all is enough, see `facing_area`; elsewhere A is infinite.
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
        part: β, shape (n,).
        by_area: Derivative of N by D, shape (n, dim), [1 / length²] or [1 / length].
    """

    point: np.ndarray
    normal: np.ndarray
    length: np.ndarray
    part: np.ndarray
    by_area: np.ndarray

    @classmethod
    def of(
        cls,
        slave: FacetedSurface,
        master: FacetedSurface,
        node: np.ndarray,
        weight: sp.csr_matrix,
        area: np.ndarray,
    ) -> MasterNormals:
        """Find them among points at nodes of the slave, shape (n,), with weights (n, len(master.nodes)).

        `area`: D, shape (n,).
        """
        enough = np.full(len(node), np.inf) if slave.sharp is None else slave.sharp[node]
        point = np.flatnonzero(np.isfinite(enough))
        enough = enough[point]
        own = -slave.normals[node[point]]
        mean = slave.within(weight[point] @ master.normals, slave.mirrored[node[point]])
        t = np.where(mean.any(axis=1), np.minimum(1.0, area[point] / enough), 0.0)
        part, away = (t * t * (3.0 - 2.0 * t))[:, None], mean - own
        summed = own + part * away
        length = np.linalg.norm(summed, axis=1)
        by_area = (6.0 * t * (1.0 - t) / enough)[:, None] * away
        return cls(point, summed / length[:, None], length, part[:, 0], by_area)

    def across(self, vectors: np.ndarray) -> np.ndarray:
        """Return the derivatives by N of those by the normals, shape (n, dim)."""
        along = np.einsum("nd,nd->n", vectors, self.normal)[:, None]
        return (vectors - along * self.normal) / self.length[:, None]


def normals_at(
    slave: FacetedSurface, master: FacetedSurface, node: np.ndarray, weight: sp.csr_matrix, area: np.ndarray
) -> np.ndarray:
    """Return the unit normals of points, from master to slave, shape (n, dim); arguments as before."""
    normal, of_master = -slave.normals[node], MasterNormals.of(slave, master, node, weight, area)
    normal[of_master.point] = of_master.normal
    return normal
