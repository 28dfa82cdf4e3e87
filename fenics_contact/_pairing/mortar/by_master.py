"""Mortar points with normals of the master: inclined nodes of undeformed slaves, and the reverse mode.

Where displacements are small, faces beside a corner keep their inclination to what they are pressed on, and
have the normals of that, as the corner has. Smooth surfaces that are inclined that much do not touch.
"""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np

from fenics_contact._pairing.coupling_derivatives import CouplingDerivatives
from fenics_contact._pairing.mortar.coupling import MortarCoupling
from fenics_contact._pairing.mortar.normals import MasterNormals, normals_at
from fenics_contact._surfaces.facets import FacetedSurface

#: Angle between the surfaces from which on undeformed points have the normal of the master, in degrees.
INCLINED = 10.0


def with_inclined(
    slave: FacetedSurface, master: FacetedSurface, coupling: MortarCoupling
) -> tuple[FacetedSurface, MortarCoupling]:
    """Return the slave with its inclined nodes among the sharp ones, and the coupling with their normals."""
    if slave.sharp is None:
        return slave, coupling
    node, weight = coupling.node, coupling.weight
    other = weight @ master.normals
    cosine = -np.einsum("nd,nd->n", other, slave.normals[node])
    inclined = cosine < np.cos(np.radians(INCLINED)) * np.linalg.norm(other, axis=1)
    sharp = slave.sharp.copy()
    sharp[node[inclined]] = coupling.area[inclined]
    slave = replace(slave, sharp=sharp)
    normal = normals_at(slave, master, node, weight, coupling.area)
    apart = coupling.of_slave(slave.points) - weight @ master.points + coupling.relief
    return slave, replace(coupling, normal=normal, gap=np.einsum("nd,nd->n", normal, apart))


@dataclass(frozen=True)
class NormalsPulledBack:
    """Derivatives of a scalar by what the normals of points are made of.

    Attributes:
        slave: By the slave's normal at each point, shape (n, dim).
        master: By the normals of the master's nodes, shape (len(master.nodes), dim).
        summed: By Σ_j W_j m_j, zero where the slave's normals count, shape (n, dim).
        area: By the areas of the points that face the master, shape (n,).
    """

    slave: np.ndarray
    master: np.ndarray
    summed: np.ndarray
    area: np.ndarray

    @classmethod
    def of(
        cls, slave: FacetedSurface, master: FacetedSurface, coupling: MortarCoupling, by: CouplingDerivatives
    ) -> NormalsPulledBack:
        """Differentiate through the normals themselves, and through the gaps along them."""
        node = coupling.node
        apart = coupling.of_slave(slave.points) - coupling.weight @ master.points + coupling.relief
        by_normal = by.normal + by.gap[:, None] * apart
        chosen = MasterNormals.of(slave, master, node, coupling.weight, coupling.area)
        by_slave, by_summed, by_area = -by_normal, np.zeros_like(by_normal), np.zeros(len(node))
        by_all, part = chosen.across(by_normal[chosen.point]), chosen.part[:, None]
        by_slave[chosen.point] = (part - 1.0) * by_all
        by_summed[chosen.point] = slave.within(part * by_all, slave.mirrored[node[chosen.point]])
        by_area[chosen.point] = np.einsum("nd,nd->n", chosen.by_area, by_all)
        return cls(by_slave, coupling.weight.T @ by_summed, by_summed, by_area)

    def with_weights(self, by: CouplingDerivatives, master: FacetedSurface) -> CouplingDerivatives:
        """Return derivatives by a coupling with those of N by weights and areas; gaps have fixed normals."""
        if not self.summed.any():
            return by
        own = None if by.own is None else np.hstack([by.own, np.zeros((len(by.own), master.dim))])
        left, right = np.hstack([by.left, self.summed]), np.hstack([by.right, master.normals])
        return replace(by, area=by.area + self.area, left=left, right=right, own=own)
